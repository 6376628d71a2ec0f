"""Two records of one pressure: a clock or a unit that is wrong shows in them."""

import numpy as np
import pytest

from pipeline.ingest.pressures import Unlike, unlike

TIME = np.arange(0.0, 20000.0, 4.0)
#: Dives to 50, 80, 110 ... dbar, an hour each.
PRESSURE = (50.0 + 30.0 * (TIME // 3600.0)) * np.abs(np.sin(np.pi * TIME / 3600.0))


def test_records_of_one_pressure_agree_whatever_their_clocks_and_noise() -> None:
    other = TIME[::7] + 1.3
    noisy = np.interp(other, TIME, PRESSURE) + np.random.default_rng(0).normal(0.3, 0.5, other.size)
    assert unlike(TIME, PRESSURE, other, noisy) is None
    assert unlike(TIME, PRESSURE, TIME, np.where(TIME < 9000.0, PRESSURE, np.nan)) is None


@pytest.mark.parametrize(
    ("shift", "words"), [(7200.0, "7200 s later"), (-5000.0, "5000 s earlier"), (28800.0, "28800 s later")]
)
def test_a_clock_that_is_hours_off_is_found(shift: float, words: str) -> None:
    assert unlike(TIME, PRESSURE, TIME[::5] + shift, PRESSURE[::5]) == Unlike(f"the pressures, {words},")


def test_another_unit_is_found() -> None:
    assert unlike(TIME, PRESSURE, TIME, 0.1 * PRESSURE) == Unlike("0.1 times the pressures", by_unit=True)
    assert unlike(TIME, 0.1 * PRESSURE, TIME, PRESSURE) == Unlike("10 times the pressures", by_unit=True)


def test_another_dive_is_told() -> None:
    other = 300.0 * np.abs(np.sin(np.pi * TIME / 1111.0))
    told = unlike(TIME, PRESSURE, TIME, other)
    assert told is not None
    assert told.found.startswith("pressures that are typically ")


def test_of_too_little_nothing_is_said() -> None:
    assert unlike(TIME[:10], PRESSURE[:10], TIME, PRESSURE) is None
    assert unlike(TIME, 0.0 * PRESSURE, TIME, 0.0 * PRESSURE + 5.0) is None
    assert unlike(TIME, PRESSURE, TIME + 1e7, 200.0 * np.abs(np.sin(np.pi * TIME / 1111.0))) is None
