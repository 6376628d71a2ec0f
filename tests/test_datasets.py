"""Public data sets: the registry names what is at hand, and every failure is one line."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
import yaml

from pipeline import datasets, vehicle
from pipeline.findings import InputError
from pipeline.mission import Mission

#: Where the files of a data set lie among the real logs.
PLACES = {
    "comet2016": "slocum/comet2016/raw",
    "sg171-ekamsat2024": "seaglider/sg171_ekamsat2024",
    "sg249-nanoos2024": "seaglider/sg249_nanoos2024",
    "sg561-lofoten2016": "seaglider/sg561_lofoten2016",
    "sg005-2008": "seaglider/sg005_2008",
}


@pytest.mark.parametrize("name", sorted(datasets.load()))
def test_hashes_are_those_of_the_files(name: str, data: Path) -> None:
    for file, (_, digest) in datasets.load()[name].files.items():
        assert hashlib.sha256((data / PLACES[name] / file).read_bytes()).hexdigest() == digest, file


@pytest.mark.parametrize("name", sorted(datasets.load()))
def test_addresses_name_a_whole_commit_and_missions_a_known_vehicle(name: str) -> None:
    found = datasets.load()[name]
    for file, (address, digest) in found.files.items():
        host, owner, repository, commit = address.removeprefix("https://").split("/")[:4]
        assert host == "raw.githubusercontent.com"
        assert f"{owner}/{repository}" == found.repository
        assert len(bytes.fromhex(commit)) == 20
        assert len(bytes.fromhex(digest)) == 32
        assert address.endswith(f"/{file}")
    assert Mission(**yaml.safe_load(found.mission)).vehicle in vehicle.names()


def test_what_comes_is_put_beside_a_mission_yaml_that_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr("pooch.retrieve", lambda address, **options: asked.append(options["fname"]))
    datasets.fetch("comet2016", tmp_path)
    assert asked == list(datasets.load()["comet2016"].files)
    assert "salinity: baltic" in (tmp_path / "mission.yaml").read_text()
    (tmp_path / "mission.yaml").write_text("vehicle: slocum-g2\n")
    datasets.fetch("comet2016", tmp_path)
    assert (tmp_path / "mission.yaml").read_text() == "vehicle: slocum-g2\n"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ConnectionError("refused"), "11d38bfd.cac: found no answer from https://raw.githubusercontent.com/"),
        (ValueError("hash"), "11d38bfd.cac: found another content at https://raw.githubusercontent.com/"),
    ],
)
def test_a_file_that_does_not_come_or_is_another_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, words: str
) -> None:
    def refuse(address: str, **options: object) -> None:
        raise error

    monkeypatch.setattr("pooch.retrieve", refuse)
    with pytest.raises(InputError) as caught:
        datasets.fetch("comet2016", tmp_path)
    assert str(caught.value).startswith(words)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "mission.yaml").exists()
