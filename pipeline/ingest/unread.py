"""Unread files: what lies in a mission's folder and no reader takes, and what to do where it may hold logs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pipeline.findings import Finding
from pipeline.mission import FILE

#: By extension, what a file is and what makes a log of it.
_KINDS = {
    ("xlsx", "xls", "xlsm", "ods"): ("a workbook", "save each sheet as CSV"),
    ("mat",): ("a MATLAB file", "write its arrays with writetable as CSV, or as netCDF"),
    ("json", "jsonl", "ndjson"): ("JSON", "write it as CSV"),
    ("zip", "tar", "tgz", "7z", "rar", "bz2", "xz", "zst"): ("an archive", "unpack it in the mission's folder"),
    ("h5", "hdf5", "hdf", "sqlite", "db", "pkl", "npy", "npz", "rds", "rdata", "feather"): (
        "a file of a format that is not read",
        "write it as CSV or Parquet",
    ),
    ("bin",): ("a file of an instrument's own format", "write it as CSV with the maker's program"),
}
_BY_EXTENSION = {extension: kind for extensions, kind in _KINDS.items() for extension in extensions}
#: What is in folders for other reasons.
_OWN = (".", "~$", "readme", "license", "licence", "thumbs.db", "desktop.ini", FILE)
_SHOWN = 4
#: Folders of results, which are within a mission's where it is worked on in its own folder.
_RESULTS = ("processed", "reports")


def told(paths: list[Path]) -> list[Finding]:
    """Return a finding about the files `paths`, which nothing reads: a warning for each kind that may hold logs.

    Hidden files, locks, YAML files and a README are passed over.
    """
    kinds: dict[tuple[str, str], list[str]] = {}
    for path in paths:
        if not path.name.lower().startswith(_OWN) and path.suffix.lower() not in (".yaml", ".yml"):
            kinds.setdefault(remedy(path), []).append(path.name)
    findings = []
    for (what, todo), names in kinds.items():
        shown = listed(names)
        if todo:
            findings.append(Finding("warning", shown, "", what, "logs in a format that is read", f"not read; {todo}"))
        else:
            findings.append(Finding("note", shown, "", what))
    return findings


def out_of_reach(folder: Path, is_log: Callable[[Path], bool]) -> list[Finding]:
    """Return a warning about folders within `folder` that hold logs or are closed, and links to what is not there."""
    beside = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    below, closed = [], []
    for path in beside:
        if path.is_dir() and path.name not in _RESULTS:
            try:
                below += [path.name] if any(map(is_log, path.iterdir())) else []
            except PermissionError:
                closed.append(path.name)
    broken = [path.name for path in beside if not path.exists()]
    return [
        Finding("warning", listed(names), "", what, expected, f"not read; {todo}")
        for names, what, expected, todo in (
            (below, "logs in a folder within the mission's", "logs beside mission.yaml", "put them there, or away"),
            (closed, "a folder that may not be read", "no logs in it", "see what is in it"),
            (broken, "a link to a file that is not there", "a log", "copy the file itself"),
        )
        if names
    ]


def listed(names: list[str]) -> str:
    """Return the first of `names` for a message, and how many more there are."""
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more


def remedy(path: Path) -> tuple[str, str]:
    """Return what the file `path` is by its extension, and what makes a log of it, "" where it is none."""
    extension = path.suffix.lower().lstrip(".")
    if extension == "gz":
        return "a packed file", "unpack it in the mission's folder"
    return _BY_EXTENSION.get(extension, ("nothing that is read", ""))
