"""Fill values: the numbers that loggers and exports write where nothing was measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.findings import Finding

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    Array = npt.NDArray[np.float64]

#: 69696969 is what Slocum gliders have for a position without a fix.
CODES = (-999.0, -9999.0, -99999.0, -999999.0, 9999.0, 99999.0, 999999.0, -999.9, -9999.9, 69696969.0)
#: The same where they lie as far from the rest as that is wide: they might be measurements.
NEAR_CODES = (-99.0, -99.9, -99.99)
#: Beyond this no unit makes a measurement of a number: 9.96921e36 of netCDF, 1e20, -1e34.
_HUGE = 1e18


def fills(values: Array) -> npt.NDArray[np.bool_]:
    """Return where `values`, shape (n,), are codes for "not measured": of `CODES` or `NEAR_CODES`, outside the rest."""
    import numpy as np

    huge = np.isfinite(values) & (np.abs(values) > _HUGE)
    codes, near = _single(CODES), _single(NEAR_CODES)
    doubtful = np.isin(values, near)
    coded = np.isin(values, codes) | doubtful
    if not coded.any():
        return np.asarray(huge)
    rest = values[np.isfinite(values) & ~coded & ~huge]
    if rest.size:
        margin = np.where(doubtful, np.ptp(rest), 0.0)
        coded &= (values < rest.min() - margin) | (values > rest.max() + margin)
    return np.asarray(coded | huge)


def _single(codes: tuple[float, ...]) -> Array:
    """Return `codes` as they are, and as they come out of four bytes."""
    import numpy as np

    return np.concatenate([np.array(codes), np.array(codes, dtype=np.float32).astype(np.float64)])


def without_fills(frame: pd.DataFrame, names: list[str], file: str) -> tuple[pd.DataFrame, list[Finding]]:
    """Return `frame` with NaN for the fill values in its numeric columns `names`, and which they were."""
    import numpy as np

    changed: dict[str, Array] = {}
    where: dict[str, list[str]] = {}
    for name in names:
        values = frame[name].to_numpy(dtype=np.float64)
        mask = fills(values)
        if mask.any():
            changed[name] = np.where(mask, np.nan, values)
            for code in np.unique(values[mask]):
                where.setdefault(f"{code:.9g}", []).append(name)
    if not changed:
        return frame, []
    found = "; ".join(f"{code} in " + ", ".join(f"'{column}'" for column in columns) for code, columns in where.items())
    note = Finding("warning", file, "", f"the fill value {found}", "measurements", "taken for not measured")
    return frame.assign(**changed), [note]
