"""Water that a fairing carries along: against the closed form, another integrator, and what a vehicle file may say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from pipeline.findings import InputError
from pipeline.model.exchange import FLUSHING_BEFORE, Fairing, carried, fairing_of, lagged
from pipeline.vehicle import KNOWN, Coefficient, Vehicle, check_value


def with_fairing(vehicle: Vehicle, **given: tuple[float, float]) -> Vehicle:
    """Return `vehicle` with values and 1-sigma of what its file says of the fairing."""
    said = {name: Coefficient(*pair, KNOWN[name].unit, "a test") for name, pair in given.items()}
    return replace(vehicle, coefficients={**vehicle.coefficients, **said})


def test_a_lag_is_that_of_another_integrator() -> None:
    time = np.arange(0.0, 2000.0, 2.5)
    value = np.tanh((time - 700.0) / 150.0)
    _, expected, _ = lsim(([1.0], [240.0, 1.0]), value, time, X0=[240.0 * value[0]])
    np.testing.assert_allclose(lagged(time, value, 240.0), expected, atol=1e-9)


def test_in_a_constant_gradient_it_lifts_by_what_the_water_grew_heavier_in_a_time_constant() -> None:
    time = np.arange(0.0, 4000.0, 4.0)
    by_share, by_fold = carried(time, 2e-3 * time, 250.0)
    late = time > 2500.0
    np.testing.assert_allclose(by_share[late], 2e-3 * 250.0, rtol=1e-3)
    np.testing.assert_allclose(by_fold[late], 2e-3 * 250.0, rtol=6e-3)
    assert by_share[0] == by_fold[0] == 0.0


def test_what_is_common_to_all_the_water_lifts_nothing() -> None:
    time = np.arange(0.0, 3000.0, 7.0)
    around = 5.0 * np.sin(time / 400.0)
    np.testing.assert_allclose(carried(time, around, 300.0), carried(time, around + 17.0, 300.0), atol=1e-12)


def test_a_file_that_says_nothing_says_none_and_a_time_within_a_factor_e(petrel: Vehicle) -> None:
    assert fairing_of(petrel) == Fairing(0.0, FLUSHING_BEFORE, 0.0, FLUSHING_BEFORE)
    assert fairing_of(with_fairing(petrel, carried_water=(0.2, 0.05))) == Fairing(0.2, 300.0, 0.05, 300.0)
    full = with_fairing(petrel, carried_water=(0.2, 0.05), flushing_time=(800.0, 100.0))
    assert fairing_of(full) == Fairing(0.2, 800.0, 0.05, 100.0)
    unknown = with_fairing(petrel, carried_water=(math.nan, math.nan), flushing_time=(800.0, math.nan))
    assert fairing_of(unknown) == Fairing(0.0, 800.0, 0.0, 800.0)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("carried_water", -0.1, "v.yaml: carried_water: found -0.1 1; expected zero or a positive number"),
        ("flushing_time", 0.0, "v.yaml: flushing_time: found 0 s; expected a positive number"),
    ],
)
def test_a_fairing_that_cannot_be_is_refused(name: str, value: float, message: str) -> None:
    with pytest.raises(InputError) as caught:
        check_value(name, value, "v.yaml")
    assert str(caught.value) == message
    check_value("carried_water", 0.0, "v.yaml")
