"""Unread files: none is passed over in silence, and what may hold logs comes with what to do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.findings import InputError
from pipeline.ingest import ingest, recognise, unread
from pipeline.mission import Mission, load

LOGS = "expected logs in a format that is read; not read"


def test_files_beside_the_logs_are_told_and_cost_nothing(mission: Mission) -> None:
    without = ingest(mission)
    names = ("dives.xlsx", "flight.mat", "old.zip", "a.jpg", "b.pdf", "c.doc", "d.png", "e.gif", "f.gif")
    for name in (*names, ".DS_Store", "~$dives.xlsx", "README.md", "glider.yaml", "Thumbs.db"):
        (mission.folder / name).write_bytes(b"\x00\x01")
    beside = ingest(mission)
    assert beside.records.equals(without.records)
    new = [str(finding) for finding in beside.findings if finding not in without.findings]
    assert new == [
        "a.jpg, b.pdf, c.doc, d.png and 2 more: found nothing that is read",
        f"dives.xlsx: found a workbook; {LOGS}; save each sheet as CSV",
        f"flight.mat: found a MATLAB file; {LOGS}; write its arrays with writetable as CSV, or as netCDF",
        f"old.zip: found an archive; {LOGS}; unpack it in the mission's folder",
    ]


def test_logs_out_of_reach_are_told(mission: Mission) -> None:
    (mission.folder / "lost.csv").symlink_to("nowhere.csv")
    for name in ("more", "plots", ".cache", "reports", "cac"):
        (mission.folder / name).mkdir()
    for name in ("more/ctd.csv", ".cache/ctd.csv", "plots/a.png", "reports/index.tsv", "cac/00cda96e.cac"):
        (mission.folder / name).write_bytes(b"x")
    (mission.folder / "second.csv").mkdir()
    (mission.folder / "second.csv" / "p1710003.nc").write_bytes(b"x")
    told = [str(finding) for finding in ingest(mission).findings if "not read; " in str(finding)]
    assert told == [
        "more, second.csv: found logs in a folder within the mission's; expected logs beside mission.yaml; not read; "
        "put them there, or away",
        "lost.csv: found a link to a file that is not there; expected a log; not read; copy the file itself",
    ]


def test_a_folder_that_may_not_be_read_is_told(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    (mission.folder / "locked").mkdir()
    read = Path.iterdir

    def guarded(path: Path) -> Iterator[Path]:
        if path.name == "locked":
            raise PermissionError(13, "Permission denied", str(path))
        return read(path)

    monkeypatch.setattr(Path, "iterdir", guarded)
    told = [str(finding) for finding in ingest(mission).findings if "not read; " in str(finding)]
    assert told == ["locked: found a folder that may not be read; expected no logs in it; not read; see what is in it"]


@pytest.mark.parametrize(
    ("name", "found", "remedy"),
    [
        ("dives.xlsx", "no logs among dives.xlsx", "save each sheet as CSV; put the logs beside mission.yaml"),
        ("x.jsonl", "no logs among x.jsonl", "write it as CSV; put the logs beside mission.yaml"),
        ("p1.nc.gz", "no logs among p1.nc.gz", "unpack it in the mission's folder; put the logs beside mission.yaml"),
        ("photo.jpg", "no logs among photo.jpg", "put the logs beside mission.yaml"),
        ("delayed/a.csv", "nothing but folders: delayed", "put the logs beside mission.yaml"),
    ],
)
def test_a_folder_without_logs_says_what_to_do_with_what_is_there(
    tmp_path: Path, name: str, found: str, remedy: str
) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"x")
    (tmp_path / "mission.yaml").write_text("vehicle: petrel-ii\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        recognise(load(tmp_path))
    assert caught.value.finding.found == found
    assert caught.value.finding.remedy == remedy


def test_what_is_missing_may_be_in_a_file_that_is_not_read(mission: Mission) -> None:
    (mission.folder / "attitude.csv").rename(mission.folder / "attitude.csv.bz2")
    with pytest.raises(InputError, match=r"found no pitch in .*; attitude.csv.bz2: found an archive; .*; unpack it"):
        ingest(load(mission.folder))


def test_many_tables_beside_a_glider_s_own_files_are_counted() -> None:
    assert unread.listed([f"p{k}.asc" for k in range(300)]) == "p0.asc, p1.asc, p2.asc, p3.asc and 296 more"
    assert unread.listed(["a", "b"]) == "a, b"
