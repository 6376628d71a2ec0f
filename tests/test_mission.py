"""mission.yaml: what it may say, and the one line that anything else gets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from pipeline import mission
from pipeline.findings import InputError
from pipeline.mission import Mission

Refusal = Callable[[str], str]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return an empty folder of a mission called trial."""
    path = tmp_path / "trial"
    path.mkdir()
    return path


@pytest.fixture
def refusal(folder: Path) -> Refusal:
    """Return how to learn what is said to a mission.yaml that is refused."""

    def say(text: str) -> str:
        (folder / "mission.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(InputError) as error:
            mission.load(folder)
        return str(error.value)

    return say


def test_the_vehicle_alone_is_enough(folder: Path) -> None:
    (folder / "mission.yaml").write_text("vehicle: petrel-ii\n")
    found = mission.load(folder)
    assert found.vehicle == "petrel-ii"
    assert found.slug == "trial"
    assert found.format == "auto"
    assert (found.pitch.scale, found.pitch.offset_rad) == (1.0, 0.0)
    assert (found.minimum_block_s, found.block_s) == (60.0, 300.0)
    assert found.folder == folder


def test_a_full_mission_is_read_as_written(folder: Path) -> None:
    text = """vehicle: slocum-g2
name: comet
salinity: baltic
latitude: 54.75
pitch: {scale: 0.86, offset_rad: -0.004}
dives: [2, 9]
files:
  ctd.csv:
    time: {column: when, unit: ms}
    timezone: Europe/Berlin
    columns: {pressure: {column: P, unit: bar}, pitch: Pitch}
    ignore: [junk]
nominal:
  - {name: down, net_buoyancy: -7.0, propeller_speed_rpm: 1400, direction: down, powered: true}
"""
    (folder / "mission.yaml").write_text(text)
    found = mission.load(folder)
    assert found.slug == "comet"
    assert found.dives == (2, 9)
    assert found.files["ctd.csv"].columns["pressure"] == mission.TableColumn(column="P", unit="bar")
    assert found.files["ctd.csv"].columns["pitch"] == "Pitch"
    assert found.nominal[0].propeller_speed_rpm == 1400.0


def test_a_mission_cannot_be_changed() -> None:
    with pytest.raises(ValidationError):
        Mission(vehicle="petrel-ii").vehicle = "other"


def test_a_missing_mission_yaml_is_shown_the_smallest_one(folder: Path) -> None:
    with pytest.raises(InputError) as error:
        mission.load(folder)
    assert str(error.value) == (
        "trial/mission.yaml: found no mission.yaml; expected one; the smallest useful one is 'vehicle: slocum-g2'"
    )


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("vehicel: slocum-g2", "vehicel: found an unknown key; did you mean 'vehicle'?"),
        ("vehicle: p\npitch: {scal: 1}", "pitch.scal: found an unknown key; did you mean 'scale'?"),
        (
            "vehicle: p\nfiles: {a.csv: {colums: {}}}",
            "files.a.csv.colums: found an unknown key; did you mean 'columns'?",
        ),
        (
            "vehicle: p\nfiles: {a.csv: {columns: {pitch: {colum: x}}}}",
            "files.a.csv.columns.pitch.colum: found an unknown key; did you mean 'column'?",
        ),
        (
            "vehicle: p\nnominal: [{name: a, net_buoyancy: 1, directon: up}]",
            "nominal.0.directon: found an unknown key; did you mean 'direction'?",
        ),
        (
            "vehicle: p\nballast: {xyz: 1}",
            "ballast.xyz: found an unknown key; known: mass, neutral_density, std, volume",
        ),
        ("vehicle: p\nfolder: logs", "folder: found an unknown key; did you mean 'files'?"),
        ("latitude: 100\nlongtude: 3", "longtude: found an unknown key; did you mean 'longitude'?"),
    ],
)
def test_a_misspelt_key_is_told_the_nearest(refusal: Refusal, text: str, line: str) -> None:
    assert refusal(text) == f"trial/mission.yaml: {line}"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("vehicle: p\nlatitude: 100", "latitude: found 100; expected less than or equal to 90 degrees north"),
        ("vehicle: p\nlatitude: .nan", "latitude: found nan; expected a finite number"),
        ("vehicle: p\nlatitude: north", "latitude: found 'north'; expected a number"),
        ("vehicle: p\nblock_s: -1", "block_s: found -1; expected greater than 0 s"),
        ("vehicle: p\npitch: {scale: 0.1}", "pitch.scale: found 0.1; expected a size greater than 0.2"),
        ("vehicle: p\npitch: {scale: -0.1}", "pitch.scale: found -0.1; expected a size greater than 0.2"),
        ("vehicle: p\nformat: dbd", "format: found 'dbd'; expected 'auto', 'slocum', 'seaglider' or 'table'"),
        ("vehicle: p\npitch: 5", "pitch: found 5; expected keys and their values"),
        ("vehicle: p\nfiles: {a.csv: }", "files.a.csv: found nothing; expected keys and their values"),
        ("vehicle: p\nfiles: [a]", "files: found ['a']; expected keys and their values"),
        ("vehicle: p\nnominal: {a: 1}", "nominal: found {'a': 1}; expected a list"),
        ("vehicle: p\ndives: [5, 2]", "dives: found [5, 2]; expected the first dive and the last, in this order"),
        (
            "vehicle: p\nconfigurations: [{name: a, dives: [5, 2]}]",
            "configurations.0.dives: found [5, 2]; expected the first dive and the last, in this order",
        ),
        (
            "vehicle: p\nconfigurations: [{name: a, dives: [1, 5]}, {name: b, dives: [5, 9]}]",
            "configurations: found [{'name': 'a', 'dives': [1, 5]}, {'name': 'b', 'dives': [5, 9]}]; "
            "expected each dive in one configuration at most",
        ),
        (
            "vehicle: p\nconfigurations: [{name: a, dives: [1, 5]}, {name: a, dives: [6, 9]}]",
            "configurations: found [{'name': 'a', 'dives': [1, 5]}, {'name': 'a', 'dives': [6, 9]}]; "
            "expected configurations of different names",
        ),
        ("vehicle: p\ndives: [1]", "dives.1: found nothing; expected a value"),
        ("vehicle: p\ndives: [1, x]", "dives.1: found 'x'; expected a whole number"),
        ("name: a", "vehicle: found nothing; expected a value; add 'vehicle: …'"),
        ("vehicle: p\nnominal: [{name: a}]",
         "nominal.0.net_buoyancy: found nothing; expected a value; add 'nominal.0.net_buoyancy: …'"),
        (
            "vehicle: p\nballast: {volume: 0.07, neutral_density: 1020}",
            "ballast: found {'volume': 0.07, 'neutral_density': 1020}; expected volume or neutral_density, not both",
        ),
        (
            "vehicle: p\nballast: {mass: 70, volume: 0.7}",
            "ballast: found {'mass': 70, 'volume': 0.7}; "
            "expected a mass in kg and a volume in m3 that are 900 to 1100 kg/m3 together",
        ),
        ("vehicle: p\nballast: {mass: 70000}", "ballast.mass: found 70000; expected less than 5000 kg"),
        ("vehicle: p\nballast: {volume: 68.5}", "ballast.volume: found 68.5; expected less than 5 m3"),
    ],
)  # fmt: skip
def test_a_value_out_of_range_is_told_what_is_expected(refusal: Refusal, text: str, line: str) -> None:
    assert refusal(text) == f"trial/mission.yaml: {line}"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("vehicle: p\n  name: x: y", "line 2: found text that is not YAML; expected key: value"),
        (
            "\tvehicle: p",
            "line 1: found text that is not YAML; expected key: value; a tab is there; YAML takes spaces",
        ),
        ("vehicle:", "vehicle: found nothing; expected text"),
        ("vehicle: p\nlatitude: yes", "latitude: found True; expected a number"),
        ("vehicle: p\nballast: {volume: on}", "ballast.volume: found True; expected a number"),
        ("vehicle: p\npitch: {scale: 1", "line 2: found text that is not YAML; expected key: value"),
        ("", "found no keys; expected at least 'vehicle: NAME'"),
        ("- vehicle: p", "found no keys; expected at least 'vehicle: NAME'"),
        ("vehicle: p\nvehicle: q", "line 2: found 'vehicle' a second time; expected each key once"),
        (
            "vehicle: p\nfiles:\n  a.csv:\n    ignore: []\n    ignore: [x]",
            "line 5: found 'ignore' a second time; expected each key once",
        ),
    ],
)
def test_text_that_is_not_yaml_is_told_the_line(refusal: Refusal, text: str, line: str) -> None:
    assert refusal(text) == f"trial/mission.yaml: {line}"


def test_bytes_that_are_no_text_are_refused_in_one_line(folder: Path) -> None:
    (folder / "mission.yaml").write_bytes(b"vehicle: \xff\xfe")
    with pytest.raises(InputError) as error:
        mission.load(folder)
    assert str(error.value) == (
        "trial/mission.yaml: found text that is not UTF-8; expected key: value; "
        "save it as UTF-8, or write it without accents"
    )


def test_a_yaml_that_contains_itself_is_refused_in_one_line(refusal: Refusal) -> None:
    assert refusal("vehicle: p\nfiles: &x {a.csv: *x}") == (
        "trial/mission.yaml: files.a.csv.a.csv: found an unknown key; known: columns, ignore, time, timezone"
    )


json_like = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from([*Mission.model_fields, "scale", "column", "x"]), inner, max_size=4)
    ),
    max_leaves=8,
)


@given(json_like)
def test_whatever_mission_yaml_says_it_is_a_mission_or_one_line(
    tmp_path_factory: pytest.TempPathFactory, content: object
) -> None:
    folder = tmp_path_factory.mktemp("any")
    (folder / "mission.yaml").write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")
    said = ""
    try:
        mission.load(folder)
    except InputError as error:
        said = str(error)
    assert len(said.splitlines()) <= 1
