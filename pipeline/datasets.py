"""Public data sets of real gliders: where each file stands and what it must contain; fetched, never shipped."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline import store
from pipeline.findings import InputError, nearest
from pipeline.mission import FILE
from pipeline.progress import Bar

REGISTRY = Path(__file__).parent / "datasets.yaml"


@dataclass(frozen=True)
class Dataset:
    """One data set: its repository, its licence, its files, and a mission.yaml to run it with.

    Attributes
    ----------
    name, description, repository, licence
        As in datasets.yaml.
    mission
        Content of mission.yaml.
    files
        File name to its address and the SHA-256 of its content.
    """

    name: str
    description: str
    repository: str
    licence: str
    mission: str
    files: dict[str, tuple[str, str]]


def load() -> dict[str, Dataset]:
    """Return the data sets by name."""
    import yaml

    content: dict[str, Any] = yaml.safe_load(REGISTRY.read_text(encoding="utf-8"))
    return {name: _parse(name, entry) for name, entry in content.items()}


def _parse(name: str, entry: dict[str, Any]) -> Dataset:
    repository = entry["repository"]
    files = {
        file: (f"https://raw.githubusercontent.com/{repository}/{commit}/{group['folder']}/{file}", digest)
        for group in entry["files"]
        for commit in [group["commit"]]
        for file, digest in group["sha256"].items()
    }
    return Dataset(name, entry["description"], repository, entry["licence"], entry["mission"], files)


def fetch(name: str, out: Path) -> Dataset:
    """Fetch the data set `name` into the folder `out`, with a mission.yaml unless there is one.

    Files that are there already, with the right content, are left alone.

    Raises
    ------
    InputError
        If there is no such data set, a file does not come, or it is not what it should be.
    """
    known = load()
    if name not in known:
        raise InputError("fetch", found=f"'{name}'", expected="a known data set", remedy=nearest(name, list(known)))
    import pooch

    pooch.get_logger().setLevel("ERROR")
    found = known[name]
    with Bar(len(found.files)) as bar:
        for done, (file, (address, digest)) in enumerate(found.files.items()):
            bar.update(done, [file])
            try:
                pooch.retrieve(address, known_hash=f"sha256:{digest}", fname=file, path=out)
            except OSError as error:
                raise InputError(
                    file,
                    found=f"no answer from {address} ({type(error).__name__})",
                    expected="the file",
                    remedy=f"try again, or put it into {out} by hand",
                ) from error
            except ValueError as error:
                raise InputError(
                    file,
                    found=f"another content at {address}",
                    expected=f"SHA-256 {digest}",
                    remedy="get it from its publisher",
                ) from error
    if not (out / FILE).exists():
        store.write_text(out / FILE, found.mission)
    return found
