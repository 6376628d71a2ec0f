"""Provenance: the inputs, configuration and software that every result came from, so that nothing is done twice.

A stage is described by a key: content digests of what it reads, the part of the configuration that can change its
result, and the software (a digest of the sources it uses and the versions of the libraries). The key and the digests
of what the stage wrote are kept in provenance.json; a stage whose key is the same, and whose results are still what
it wrote, need not run again. Nothing in it depends on when or where a run took place.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from pathlib import Path
from typing import Any

import pipeline
from pipeline import store

FILE = "provenance.json"
PACKAGE = Path(__file__).parent

#: The rooms whose sources a stage's result depends on, beside the ground floor.
ROOMS: dict[str, tuple[str, ...]] = {
    "ingest": ("ingest",),
    "estimate": ("estimate", "model"),
    "model": ("model",),
    "report": ("report", "model"),
}

#: Modules outside the rooms that no stage's result depends on.
OUTSIDE = (
    "analysis.py",
    "check.py",
    "cli.py",
    "datasets.py",
    "instruments.py",
    "plan.py",
    "progress.py",
    "simulate.py",
    "theory.py",
    "trials.py",
    "voyage.py",
    "workers.py",
)

#: Libraries that have a say in the numbers or the pages.
LIBRARIES = (
    "bokeh",
    "cmocean",
    "dbdreader",
    "filterpy",
    "gsw",
    "h5netcdf",
    "h5py",
    "jinja2",
    "llvmlite",
    "matplotlib",
    "numba",
    "numpy",
    "pandas",
    "pyarrow",
    "pydantic",
    "pyyaml",
    "scipy",
    "xarray",
)


def sources(stage: str) -> list[Path]:
    """Return the files of the package that the result of `stage` depends on, vehicles excepted."""
    found = [path for path in PACKAGE.glob("*.py") if path.name not in OUTSIDE]
    for room in ROOMS[stage]:
        found += [path for path in (PACKAGE / room).rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    return sorted(found)


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions of Python and of the `LIBRARIES` that are installed."""
    found = {"seatrial": pipeline.__version__, "python": f"{sys.version_info.major}.{sys.version_info.minor}"}
    for name in LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


@functools.cache
def code(stage: str) -> str:
    """Return one digest of all the `sources` of `stage`."""
    return store.digest_text(
        "\n".join(f"{path.relative_to(PACKAGE).as_posix()} {store.digest(path)}" for path in sources(stage))
    )


def digests(paths: Mapping[str, Path]) -> dict[str, str]:
    """Return the content digest of each file, by the name it is to be known under."""
    with ThreadPoolExecutor() as pool:
        return dict(zip(paths, pool.map(store.digest, paths.values()), strict=True))


def key(stage: str, inputs: Mapping[str, str], configuration: Mapping[str, Any]) -> dict[str, Any]:
    """Return all that the result of `stage` depends on, in JSON's own types."""
    software = {"code": code(stage), **versions()}
    described: dict[str, Any] = store.plain(
        {"inputs": dict(inputs), "configuration": dict(configuration), "software": software}
    )
    return described


def read(folder: Path) -> dict[str, dict[str, Any]]:
    """Return what is recorded in `folder`: stage name to its key and outputs; empty if nothing is."""
    try:
        content = store.read_json(folder / FILE)
    except (OSError, ValueError):
        return {}
    stages = content.get("stages") if isinstance(content, dict) else None
    return stages if isinstance(stages, dict) else {}


def is_current(recorded: Mapping[str, Any] | None, described: Mapping[str, Any], locate: Callable[[str], Path]) -> bool:
    """Return whether a stage was run with the key `described` and its results are as it wrote them.

    Parameters
    ----------
    recorded
        Entry of the stage in provenance.json, None if there is none.
    described
        Its `key` now.
    locate
        Path of a result by its name.
    """
    if recorded is None or {name: recorded.get(name) for name in described} != described:
        return False
    outputs = recorded.get("outputs", {})
    try:
        return bool(outputs) and all(store.digest(locate(name)) == digest for name, digest in outputs.items())
    except OSError:
        return False


def record(folder: Path, stage: str, described: Mapping[str, Any], outputs: Mapping[str, str]) -> None:
    """Record a stage that has just been run."""
    stages = {**read(folder), stage: {**described, "outputs": dict(outputs)}}
    _write(folder, {name: stages[name] for name in ROOMS if name in stages})


def forget(folder: Path, stage: str) -> None:
    """Drop the record of `stage` and of those after it."""
    stages = read(folder)
    order = list(ROOMS)
    kept = {name: stages[name] for name in order[: order.index(stage)] if name in stages}
    if kept != stages:
        _write(folder, kept)


def _write(folder: Path, stages: Mapping[str, Any]) -> None:
    store.write_json(folder / FILE, {"mission": folder.name, "stages": stages})
