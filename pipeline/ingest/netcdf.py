"""netCDF files: a few variables out of the many hundreds that a glider's file may hold, as plain arrays.

`xarray` masks and scales the values by the CF conventions; the files are opened beneath it, because opening all
700 variables of a Seaglider file through it takes seconds a file, and twenty are wanted.
"""

from __future__ import annotations

import mmap
import re
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.findings import InputError
from pipeline.ingest.logs import UnreadableError

Variables = dict[str, npt.NDArray[Any]]

_CLASSIC = (b"CDF\x01", b"CDF\x02")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HEAP = b"GCOL\x01\0\0\0"
#: Flags may be letters.
_FLAG = re.compile(r"_(qc|quality_control|flag)$", re.IGNORECASE)
_ATTRIBUTES = ("_FillValue", "missing_value", "scale_factor", "add_offset")


def require() -> None:
    """Raise `InputError` with the remedy if the packages that read netCDF cannot be imported."""
    try:
        import h5netcdf  # noqa: F401
        import xarray  # noqa: F401
    except ImportError as error:
        raise InputError(
            "netCDF files", found=f"no {error.name} to read them with", remedy="pip install 'seatrial[netcdf]'"
        ) from error


def variables(path: Path, wanted: re.Pattern[str]) -> Variables:
    """Return the variables of `path` whose names match `wanted` from end to end.

    Parameters
    ----------
    path
        netCDF file, classic (versions 1 and 2) or netCDF-4.
    wanted
        Pattern of names.

    Raises
    ------
    UnreadableError
        If the file is empty, cut short, or no netCDF.
    """
    import xarray

    magic = _magic(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            raw = _netcdf4(path, wanted) if magic == _HDF5 else _classic(path, wanted)
            data = xarray.decode_cf(xarray.Dataset(raw), decode_times=False, decode_coords=False)
            return {str(name): np.asarray(variable.values) for name, variable in data.variables.items()}
    except Exception as error:  # whatever a damaged file makes of offsets, lengths and types
        raise UnreadableError("a damaged netCDF file", "a whole one") from error


def series(path: Path) -> tuple[dict[tuple[str, ...], dict[str, str]], dict[str, str]]:
    """Return what series there are in `path`.

    Returns
    -------
    units, meanings
        By dimensions the numeric variables that have any, and flags that are letters, and their units, "" where none
        is stated; and the standard names of those that have one.

    Raises
    ------
    UnreadableError
        As `variables`.
    """
    from scipy.io import netcdf_file

    out: dict[tuple[str, ...], dict[str, str]] = {}
    meanings: dict[str, str] = {}
    magic = _magic(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with _hdf5(path) if magic == _HDF5 else netcdf_file(path, "r", mmap=False) as file:
                for name, variable in file.variables.items():
                    dtype = np.dtype(variable.dtype if magic == _HDF5 else variable.data.dtype)
                    letters = dtype == "S1" and bool(_FLAG.search(str(name)))
                    if variable.dimensions and (dtype.kind in "fiu" or letters):
                        attributes = variable.attrs if magic == _HDF5 else variable.__dict__
                        along = tuple(map(str, variable.dimensions))
                        along = along[:-1] if letters and len(along) > 1 and variable.shape[-1] == 1 else along
                        out.setdefault(along, {})[str(name)] = _text(attributes, "units")
                        if meaning := _text(attributes, "standard_name"):
                            meanings[str(name)] = meaning
    except Exception as error:  # whatever a damaged file makes of offsets, lengths and types
        raise UnreadableError("a damaged netCDF file", "a whole one") from error
    return out, meanings


def _text(attributes: Any, name: str) -> str:
    value = attributes.get(name, "")
    return (value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)).strip()


def _magic(path: Path) -> bytes:
    """Return the first bytes of `path` if they are those of netCDF."""
    try:
        with path.open("rb") as file:
            magic = file.read(8)
    except OSError as error:
        raise UnreadableError(f"a file that cannot be opened ({error.strerror})", remedy="left out") from error
    if not magic:
        raise UnreadableError("an empty file", "netCDF")
    if magic != _HDF5 and magic[:4] not in _CLASSIC:
        raise UnreadableError("no netCDF header", "netCDF, classic or 4")
    return magic


def _hdf5(path: Path) -> Any:
    """Return an open netCDF-4 file, if neither its heaps nor the attributes of its root are damaged.

    HDF5 never returns from a heap that holds free space of no size, and h5netcdf complains of damaged attributes
    a second time, as the file goes, where nobody can catch it.

    Raises
    ------
    ValueError
        If there is such free space.
    """
    import h5netcdf
    import h5py

    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        start = content.find(_HEAP)
        while start >= 0:
            _check_heap(content, start)
            start = content.find(_HEAP, start + 1)
    with h5py.File(path, "r") as plain:
        plain.attrs.get("_nc3_strict")
    return h5netcdf.File(path, "r")


def _check_heap(content: mmap.mmap, start: int) -> None:
    """Raise ValueError if free space of no size is among the objects of the heap collection at `start`.

    HDF5 File Format Specification 3.0, III.E: 16 bytes of header, then objects, each of index, count, size and data.
    """
    at, end = start + 16, min(start + int.from_bytes(content[start + 8 : start + 16], "little"), len(content))
    while at + 16 <= end:
        index, size = struct.unpack_from("<H6xQ", content, at)
        if not index and not size:
            raise ValueError("a damaged heap")
        at += 16 + -(-size // 8) * 8 if index else size


def _netcdf4(path: Path, wanted: re.Pattern[str]) -> dict[str, Any]:
    import xarray

    with _hdf5(path) as file:
        return {
            name: xarray.Variable(
                variable.dimensions,
                variable[...],
                {key: variable.attrs[key] for key in _ATTRIBUTES if key in variable.attrs},
            )
            for name in file.variables
            if wanted.fullmatch(name)
            for variable in [file.variables[name]]
        }


def _classic(path: Path, wanted: re.Pattern[str]) -> dict[str, Any]:
    import xarray
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        return {
            name: xarray.Variable(
                variable.dimensions,
                np.array(variable.data).astype(variable.data.dtype.newbyteorder("=")),
                {key: getattr(variable, key) for key in _ATTRIBUTES if hasattr(variable, key)},
            )
            for name, variable in file.variables.items()
            if wanted.fullmatch(name)
        }
