"""Files of one instrument are one, whatever column some of them lack; those of two instruments are two."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.ingest import ingest, table, turns
from pipeline.mission import Mission, load
from pipeline.records import Quality

START = 1.5e9


def _file(name: str, begin: float, *columns: str, end: float | None = None) -> pd.DataFrame:
    time = START + np.linspace(begin, begin + 9.0 if end is None else end, 10)
    frame = pd.DataFrame({"time": time} | dict.fromkeys(columns, begin))
    frame.attrs = {"name": name, "columns": {}}
    return frame


def _names(frames: list[pd.DataFrame]) -> list[str]:
    return [str(frame.attrs["name"]) for frame in turns.taken(turns.joined(frames)[0])[0]]


def test_a_file_without_a_column_stays_with_the_others_of_its_instrument() -> None:
    frames = [_file(f"{k}.csv", 10.0 * k, "pitch", "roll", "pressure") for k in (0, 2)]
    frames.append(_file("1.csv", 10.0, "pitch", "pressure").assign(pressure_qc=np.int8(1)))
    frames[-1].attrs = {"name": "1.csv", "columns": {}}
    found, findings = turns.taken(turns.joined(frames)[0])
    assert [frame.attrs["name"] for frame in found] == ["0.csv, 1.csv, 2.csv"]
    assert (np.diff(found[0]["time"]) > 0).all()
    assert found[0]["pressure"].tolist() == [0.0] * 10 + [10.0] * 10 + [20.0] * 10
    assert found[0]["roll"].isna().tolist() == [False] * 10 + [True] * 10 + [False] * 10
    assert found[0]["pressure_qc"].tolist() == [Quality.MISSING] * 10 + [1] * 10 + [Quality.MISSING] * 10
    assert [str(finding) for finding in findings] == [
        "1.csv: found files of one instrument without roll, which others have; put together in time"
    ]


def test_two_instruments_at_a_time_stay_two_though_they_share_columns() -> None:
    flight = [_file(f"gli.{k}", 10.0 * k, "pitch", "temperature", "latitude") for k in (0, 1, 3)]
    payload = [_file(f"pld.{k}", 10.0 * k, "conductivity", "temperature", "latitude") for k in (0, 1, 2)]
    assert _names([*flight, *payload]) == ["gli.0, gli.1, gli.3", "pld.0, pld.1, pld.2"]


def test_a_file_within_a_longer_one_is_another_instrument() -> None:
    long = [_file("a.csv", 0.0, "pitch", "roll", end=100.0), _file("b.csv", 200.0, "pitch", "roll", end=210.0)]
    assert _names([*long, _file("c.csv", 50.0, "pitch")]) == ["a.csv, b.csv", "c.csv"]


def _cut(whole: pd.DataFrame, name: str, first: int, last: int) -> pd.DataFrame:
    part = whole.iloc[first:last]
    part.attrs = {"name": name, "columns": {}}
    return part


@pytest.mark.parametrize("pieces", [[(0, 60), (40, 100)], [(0, 51), (50, 100)], [(0, 100), (20, 30)], [(0, 100)] * 3])
def test_records_that_files_repeat_are_used_once(pieces: list[tuple[int, int]]) -> None:
    rng = np.random.default_rng(0)
    whole = pd.DataFrame({"time": START + np.arange(100.0), "pitch": rng.normal(size=100), "roll": np.nan})
    found, findings = turns.joined([_cut(whole, f"{k}.csv", *piece) for k, piece in enumerate(pieces)])
    assert len(found) == 1
    pd.testing.assert_frame_equal(found[0], whole)
    again = sum(last - first for first, last in pieces) - 100
    assert sum(int(finding.found.split()[0]) for finding in findings) == again
    assert all(str(finding).endswith("records that another file has, too; used once") for finding in findings)


def test_a_torn_last_line_does_not_make_two_instruments_and_other_values_do() -> None:
    whole = pd.DataFrame({"time": START + np.arange(100.0), "pitch": np.arange(100.0)})
    first, second = _cut(whole, "a.csv", 0, 60), _cut(whole, "b.csv", 40, 100)
    torn = first.assign(pitch=first["pitch"].where(first.index < 59, 5.0))
    torn.attrs = first.attrs
    (found,), _ = turns.joined([torn, second])
    assert len(found) == 101
    other = second.assign(pitch=second["pitch"] + 0.1)
    other.attrs = second.attrs
    assert len(turns.joined([first, other])[0]) == 2


def test_a_mission_downloaded_in_overlapping_pieces_is_the_whole(mission: Mission) -> None:
    whole = ingest(mission).records
    logged = pd.read_csv(mission.folder / "attitude.csv")
    (mission.folder / "attitude.csv").unlink()
    for k in range(4):
        part = logged.iloc[max(k * len(logged) // 4 - 10 * k, 0) : (k + 1) * len(logged) // 4]
        part.to_csv(mission.folder / f"attitude-{k}.csv", index=False)
    pd.testing.assert_frame_equal(ingest(load(mission.folder)).records, whole)


def test_what_has_little_in_common_is_not_put_together() -> None:
    assert _names([_file("a.csv", 0.0, "pitch", "roll", "heading"), _file("b.csv", 20.0, "pressure", "roll", "T")]) == [
        "a.csv",
        "b.csv",
    ]


@pytest.mark.parametrize("change", ["less", "more"])
def test_a_mission_loses_nothing_by_a_column_that_comes_or_goes(mission: Mission, change: str) -> None:
    whole = ingest(mission).records
    logged = pd.read_csv(mission.folder / "attitude.csv")
    (mission.folder / "attitude.csv").unlink()
    for k in range(4):
        part = logged.iloc[k * len(logged) // 4 : (k + 1) * len(logged) // 4]
        if k == 1:
            part = part.drop(columns="oil_volume (cm3)") if change == "less" else part.assign(**{"roll (deg)": 1.0})
        part.to_csv(mission.folder / f"attitude-{k}.csv", index=False)
    found = ingest(load(mission.folder)).records
    pd.testing.assert_series_equal(found["pitch"], whole["pitch"])
    pd.testing.assert_series_equal(found["pressure"], whole["pressure"])
    lost = whole["buoyancy_volume"].notna().sum() - found["buoyancy_volume"].notna().sum()
    quarter = 2 * len(logged) // 4 - len(logged) // 4
    assert lost == (quarter if change == "less" else 0)


def test_a_unit_is_guessed_from_all_files_of_an_instrument_those_with_a_column_less_too(tmp_path: Path) -> None:
    for k, pitch in enumerate((-25.0, 0.5, 26.0)):
        rows = "".join(f"{START + 10 * k + j},{pitch},{j},{10 + j}\n" for j in range(5))
        head = "time,Pitch,Depth,oil_volume" if k == 1 else "time,Pitch,Depth,Temp"
        (tmp_path / f"{k}.csv").write_text(f"{head}\n{rows}", encoding="utf-8")
    (tmp_path / "mission.yaml").write_text("vehicle: petrel-ii\nlatitude: 45\n", encoding="utf-8")
    (stream,) = table.read(load(tmp_path)).streams
    np.testing.assert_allclose(stream["pitch"].iloc[[0, 5, 10]], np.radians([-25.0, 0.5, 26.0]))
