"""Which missions a folder holds: nothing in it is passed over in silence."""

from __future__ import annotations

from pathlib import Path

from pipeline.roster import plan


def _mission(folder: Path, text: str = "") -> None:
    folder.mkdir(parents=True)
    (folder / "mission.yaml").write_text("vehicle: petrel-ii\n" + text, encoding="utf-8")


def test_an_empty_folder_among_missions_is_a_failed_one(tmp_path: Path) -> None:
    _mission(tmp_path / "raw" / "good")
    (tmp_path / "raw" / "bare").mkdir()
    planned = plan(tmp_path / "raw", tmp_path, tmp_path)
    assert [job.name for job in planned.jobs] == ["good"]
    assert [str(outcome) for outcome in planned.failed] == [
        "bare: failed: raw/bare: found an empty folder; expected logs and a mission.yaml; "
        "put them there, or remove the folder"
    ]


def test_a_misspelt_mission_file_is_named(tmp_path: Path) -> None:
    _mission(tmp_path / "raw" / "good")
    _mission(tmp_path / "raw" / "bad")
    (tmp_path / "raw" / "bad" / "mission.yaml").rename(tmp_path / "raw" / "bad" / "mission.yml")
    assert [str(stranger) for stranger in plan(tmp_path / "raw", tmp_path, tmp_path).strangers] == [
        "raw/bad: found no mission.yaml; expected one in every folder of logs; not analysed; rename mission.yml to "
        "mission.yaml"
    ]


def test_a_coefficient_that_cannot_be_negative_is_refused(tmp_path: Path) -> None:
    _mission(tmp_path / "raw" / "a", "coefficients: {parasite_drag: -8.0}\n")
    assert [str(outcome) for outcome in plan(tmp_path / "raw", tmp_path, tmp_path).failed] == [
        "a: failed: mission.yaml: parasite_drag: found -8 kg/m; expected a positive number"
    ]
