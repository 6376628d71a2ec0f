"""The consistency report: against known truth, against statsmodels, and what it says of an estimate that is off."""

import json
import math
from functools import cache

import numpy as np
import pytest

from pipeline.estimate import smoother
from pipeline.estimate.consistency import LAGS, STEPS, Tally, report, tally
from pipeline.estimate.problem import Problem, Solution

M = 12_000


@cache
def simulated(seed: int, m: int = M, missing: float = 0.0) -> Problem:
    """Return a vehicle with a drifting depth rate and pitch, measurements drawn from the model itself."""
    rng = np.random.default_rng(seed)
    decay = np.tile([0.0, 0.98, 0.995, 0.9], (m, 1))
    rows = np.tile([1.0, 0.0, 1.0, 0.3], (m, 1, 1))
    noise = np.tile([1e-4, 1e-4, 2e-4, 1e-4], (m, 1))
    seen, weight = np.array([[0, 0], [1, 0]]), np.array([[1.0, 0.0], [1.0, 0.0]])
    kicks = rng.standard_normal((m, 4)) * np.sqrt(noise)
    x = np.zeros((m, 4))
    for k in range(m - 1):
        x[k + 1] = decay[k] * x[k] + kicks[k]
        x[k + 1, 0] += rows[k, 0] @ x[k]
    variance = np.tile([2.5e-3, 1e-4], (m, 1))
    observed = x[:, :2] + np.sqrt(variance) * rng.standard_normal((m, 2))
    observed[rng.random((m, 2)) < missing] = np.nan
    start = np.diag([1e-6, 1e-6, 1e-6, 1e-6])
    return Problem(
        np.zeros(4), start, decay, np.array([0]), rows, np.zeros((m, 1, 1)), noise, np.zeros((m, 4)), 0, seen, weight,
        observed, np.empty((2, 0)), variance,
    )  # fmt: skip


def judged(problem: Problem, steady: np.ndarray | None = None, time: np.ndarray | None = None) -> Tally:
    m = len(problem.observed)
    everywhere = np.ones(m, dtype=bool) if steady is None else steady
    return tally(problem, smoother.solve(problem), np.arange(float(m)) if time is None else time, everywhere)


def innovations_of(z: np.ndarray) -> Solution:
    """Return a solution with these normalised innovations, shape (m, 2)."""
    return Solution(np.zeros((len(z), 4, 1)), np.zeros((len(z), 4, 4)), 2.0 * z, np.full(z.shape, 4.0), 0.0)


@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_an_estimate_by_the_true_model_is_found_consistent(missing: float) -> None:
    found = report(judged(simulated(0, 4 * M, missing)))
    assert found["sentence"].startswith("It is consistent")
    for row in found["innovations"]:
        assert row["low_effective"] <= row["nis"] <= row["high_effective"]
        assert row["low"] == pytest.approx(1.0 - 1.96 * math.sqrt(2.0 / row["n"]), abs=1e-3)
        assert row["p"] > 0.01
    for row in found["predictions"]:
        assert row["normalised"] == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / row["n"]))
        assert row["coverage95"] == pytest.approx(0.95, abs=0.03)
        assert row["rms_error"] == pytest.approx(row["predicted_rms"], rel=0.1)


def test_whiteness_is_rejected_as_often_as_its_p_value_says_and_nis_is_inside_its_band() -> None:
    from scipy.stats import kstest

    found = [report(judged(simulated(seed, 3000))) for seed in range(1, 41)]
    for i in range(2):
        assert kstest([one["innovations"][i]["p"] for one in found], "uniform").pvalue > 0.01
        inside = [row["low"] < row["nis"] < row["high"] for row in (one["innovations"][i] for one in found)]
        assert sum(inside) >= 34  # of 40, each with a probability of 0.95


def test_process_noise_taken_half_as_large_is_found_out() -> None:
    case = simulated(0)
    found = report(judged(case._replace(noise=0.5 * case.noise)))
    assert found["sentence"].startswith("It is not quite consistent")
    assert all(row["nis"] > row["high_effective"] for row in found["innovations"])
    assert all("larger than predicted" in row["verdict"] for row in found["innovations"])
    far = [row for row in found["predictions"] if row["steps"] == 60]
    assert all(row["normalised"] > row["high"] for row in far)
    assert far[0]["normalised"] == pytest.approx(2.0, rel=0.35)


def test_noise_taken_twice_as_large_is_called_too_large() -> None:
    case = simulated(0)
    found = report(judged(case._replace(noise=2.0 * case.noise, variance=2.0 * case.variance)))
    assert all("smaller than predicted" in row["verdict"] for row in found["innovations"])
    assert all(row["nis"] == pytest.approx(0.5, abs=0.03) for row in found["innovations"])


@pytest.mark.parametrize("colour", [0.0, 0.5])
def test_ljung_box_is_that_of_statsmodels(colour: float) -> None:
    from statsmodels.stats.diagnostic import acorr_ljungbox

    rng = np.random.default_rng(3)
    z = rng.standard_normal((800, 2))
    for k in range(1, 800):
        z[k] += colour * z[k - 1]
    case = simulated(0, 800)
    rows = report(tally(case, innovations_of(z), np.arange(800.0), np.ones(800, dtype=bool)))["innovations"]
    for i, row in enumerate(rows):
        theirs = acorr_ljungbox(z[:, i], lags=[LAGS])
        assert row["ljung_box"] == pytest.approx(float(theirs["lb_stat"].iloc[0]), rel=1e-9)
        assert row["p"] == pytest.approx(float(theirs["lb_pvalue"].iloc[0]), rel=1e-9)
        assert row["whiteness"] == ("correlated" if colour else "white")
        if colour:
            assert row["greatest_lag"] == 1
            assert row["greatest_correlation"] == pytest.approx(0.5, abs=0.1)


def test_correlated_squares_count_for_less_and_widen_the_band() -> None:
    """Numbers each repeated ten times have the mean of a tenth as many."""
    z = np.repeat(np.random.default_rng(0).standard_normal((2000, 2)), 10, axis=0)
    case = simulated(0, 20_000)
    row = report(tally(case, innovations_of(z), np.arange(20_000.0), np.ones(20_000, dtype=bool)))["innovations"][0]
    assert 2000 < row["n_effective"] < 3000
    assert row["high_effective"] - 1.0 > 2.5 * (row["high"] - 1.0)


def test_tallies_of_parts_add_to_that_of_the_whole_but_for_pairs_across_the_cut() -> None:
    z = np.random.default_rng(1).standard_normal((6000, 2))
    case, time, steady = simulated(0, 6000), np.arange(6000.0), np.ones(6000, dtype=bool)
    whole = tally(case, innovations_of(z), time, steady)
    time = np.where(time < 3000, time, time + 1000.0)
    cut = tally(case, innovations_of(z), time, steady)
    parts = []
    for part in (slice(0, 3000), slice(3000, 6000)):
        moving = {name: getattr(case, name)[part] for name in ("decay", "rows", "shift", "noise", "cross")}
        measured = {name: getattr(case, name)[part] for name in ("observed", "variance")}
        parts.append(tally(case._replace(**moving, **measured), innovations_of(z[part]), time[part], steady[part]))
    total = parts[0] + parts[1]
    np.testing.assert_allclose(total.lagged, cut.lagged, rtol=1e-10, atol=1e-9)
    np.testing.assert_array_equal(total.lagged[:, 0], whole.lagged[:, 0] - np.arange(LAGS + 1))
    np.testing.assert_array_equal(total.ahead[:, :, 0], cut.ahead[:, :, 0])
    with pytest.raises(ValueError, match="instruments: found"):
        total + Tally(("depth",), whole.lagged[:1], whole.ahead[:1], whole.sensor)


def test_manoeuvres_and_pauses_are_not_judged_nor_predicted_across() -> None:
    case = simulated(2)
    spoilt = case.observed.copy()
    manoeuvre = np.arange(M) % 1000 < 100
    spoilt[manoeuvre] = 0.0
    time = np.arange(float(M)) + 200.0 * (np.arange(M) // 500)
    blind = case._replace(observed=np.where(manoeuvre[:, None], np.nan, case.observed))
    solution = smoother.solve(blind)
    total = tally(case._replace(observed=spoilt), solution, time, ~manoeuvre)
    clean = tally(blind, solution, time, ~manoeuvre)
    np.testing.assert_array_equal(total.lagged, clean.lagged)
    assert total.lagged[0, 0, 0] == np.sum(~manoeuvre)
    runs = [(100, 500), (500, 1000)]
    for s, step in enumerate(STEPS):
        each = sum(start <= k and k + step < end for k in range(0, M, max(step, 20)) for a, b in runs for start, end in
                   [(a + 1000 * (k // 1000), b + 1000 * (k // 1000))])  # fmt: skip
        assert total.ahead[0, s, 0] == each


def test_coverage_of_a_sensor_left_out_is_that_of_its_gaps() -> None:
    rng = np.random.default_rng(0)
    gap = 0.01 * rng.standard_normal(M) + 0.002
    gap[::7] = np.nan
    case = simulated(0)
    total = tally(case, smoother.solve(case), np.arange(float(M)), np.ones(M, dtype=bool),
                  held_out=np.stack([gap, np.full(M, 0.01)]))  # fmt: skip
    sensor = report(total + total)["sensor"]
    seen = gap[np.isfinite(gap)]
    assert sensor["n"] == 2 * seen.size
    assert sensor["bias"] == pytest.approx(seen.mean())
    assert sensor["rmse"] == pytest.approx(np.sqrt(np.mean(seen**2)))
    assert sensor["coverage95"] == pytest.approx(np.mean(np.abs(seen) < 0.0196))


@pytest.mark.parametrize("m", [1, 29])
def test_too_little_is_none_with_a_reason_and_always_json(m: int) -> None:
    found = report(judged(simulated(0, m)))
    assert "too little steady flight" in found["sentence"]
    assert found["sensor"] is None
    for row in found["innovations"]:
        assert row["nis"] is None
        assert row["reason"] == f"{m} measurements in steady flight; at least 30 are needed"
    assert all(row["normalised"] is None and row["reason"] for row in found["predictions"])
    json.dumps(found, allow_nan=False)


def test_no_steady_flight_is_said_so() -> None:
    found = report(judged(simulated(0), steady=np.zeros(M, dtype=bool)))
    assert all(row["n"] == 0 for row in found["innovations"])
