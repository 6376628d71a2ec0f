"""Findings and errors: one line in the same shape, everywhere."""

from __future__ import annotations

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.findings import Finding, InputError, in_one_line, nearest


def test_a_finding_reads_as_one_sentence() -> None:
    full = Finding("warning", "ctd.csv", "record 3", "a spike", "less than 3 m/s", "flagged bad")
    assert str(full) == "ctd.csv: record 3: found a spike; expected less than 3 m/s; flagged bad"
    assert str(Finding("note", "ctd.csv", "", "40 records")) == "ctd.csv: found 40 records"
    assert str(Finding("note", "gps", "fix 2", "0, 0", remedy="left out")) == "gps: fix 2: found 0, 0; left out"


def test_a_finding_is_one_line_whatever_a_library_says() -> None:
    assert "\n" not in str(Finding("error", "a.parquet", "", "a damaged file (bad\r\nheader\n)", "Parquet"))


def test_a_finding_is_plain_text_for_json() -> None:
    assert Finding("note", "a", "b", "c", "d", "e").as_dict() == {
        "severity": "note",
        "file": "a",
        "where": "b",
        "found": "c",
        "expected": "d",
        "remedy": "e",
    }


def test_an_input_error_says_what_its_finding_says() -> None:
    error = InputError("ctd.csv", "column 'P'", found="unit 'dbr'", expected="a unit", remedy="did you mean 'dbar'?")
    assert str(error) == str(error.finding)
    assert error.finding.severity == "error"


text = st.text(max_size=20)


@given(text, text, text, text, text)
def test_an_input_error_survives_the_way_to_another_process(
    file: str, where: str, found: str, expected: str, remedy: str
) -> None:
    error = InputError(file, where, found=found, expected=expected, remedy=remedy)
    again = pickle.loads(pickle.dumps(error))
    assert isinstance(again, InputError)
    assert again.finding == error.finding
    assert str(again) == str(error)


def test_the_nearest_name_is_suggested_else_all_are_listed() -> None:
    assert nearest("vehicel", ["vehicle", "name"]) == "did you mean 'vehicle'?"
    assert nearest("zzz", ["vehicle", "name"]) == "known: name, vehicle"


def test_an_error_nobody_foresaw_becomes_one_line_that_says_where() -> None:
    with pytest.raises(ZeroDivisionError) as caught:
        _ = 1 / 0
    error = in_one_line(caught.value, "ingest", "report it")
    assert "\n" not in str(error)
    assert str(error).startswith("ingest: line ")
    assert str(error).endswith("found ZeroDivisionError: division by zero; expected no such error; report it")


def test_an_error_of_the_file_system_names_the_file() -> None:
    error = in_one_line(PermissionError(13, "Permission denied", "/a/b/records.parquet"), "ingest", "")
    assert str(error) == "ingest: records.parquet: found Permission denied; expected to read and write it"


def test_an_input_error_is_left_as_it_is() -> None:
    error = InputError("a", found="b")
    assert in_one_line(error, "ingest", "") is error


def test_control_characters_never_reach_a_terminal_or_a_page() -> None:
    found = Finding("warning", "a.csv", "row 3", "'12" + 4096 * "\0" + "\x1b[31m7'", "a number").as_dict()["found"]
    assert found == "'12\\x00 (4096 times)\\x1b[31m7'"
