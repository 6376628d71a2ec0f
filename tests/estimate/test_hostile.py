"""Records as bad as they come, by both methods: finite numbers, or NaN with a reason; no exception, no warning."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import dives
import numpy as np
import pandas as pd
import pytest
from dives import PETREL, Flown
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline import vehicle
from pipeline.estimate import smoother
from pipeline.estimate.problem import Problem, Solution
from pipeline.estimate.stage import Estimated, estimate
from pipeline.records import ESTIMATES, Phase, conform, of_method
from pipeline.vehicle import Vehicle

#: A correlation matrix's eigenvalue may fall below zero by this much, by rounding.
ROUNDING = -1e-9
HIDDEN = [
    column.name for column in ESTIMATES if column.dtype == "float64" and not column.name.startswith(("pitch", "depth"))
]
STD = [column.name for column in ESTIMATES if column.name.endswith("_std")]
Damage = Callable[[pd.DataFrame], pd.DataFrame]


@pytest.fixture(scope="module")
def flown() -> Flown:
    """Return two dives."""
    return dives.fly(21, dives=((25.0, 4.0, 80.0), (35.0, 6.0, 80.0)), every=9)


def least_eigenvalue(solution: Solution) -> float:
    """Return the least eigenvalue of all smoothed covariances, each state in units of its own 1-sigma."""
    P = solution.covariance
    spread = np.sqrt(np.einsum("kii->ki", P))
    spread = np.where(spread > 0.0, spread, 1.0)
    return float(np.linalg.eigvalsh(P / spread[:, :, None] / spread[:, None, :]).min())


def survives(
    records: pd.DataFrame, flown: Flown, monkeypatch: pytest.MonkeyPatch, craft: Vehicle = PETREL
) -> Estimated:
    """Return the estimates of damaged records, having looked at every number and every covariance."""
    solved: list[Solution] = []
    solve = smoother.solve

    def watched(problem: Problem, *, whole: bool = True, room: int = 0) -> Solution:
        solution = solve(problem, whole=whole, room=room)
        if whole:
            solved.append(solution)
        return solution

    records = records.reset_index(drop=True)
    with monkeypatch.context() as patch:
        patch.setattr(smoother, "solve", watched)
        found = estimate(records, craft, flown.mission)
    conform(found.estimates, ESTIMATES)
    for method in dict.fromkeys(found.estimates["method"]):
        rows = of_method(found.estimates, method)
        assert len(rows) == len(records)
        seen = rows["observable"].to_numpy()
        assert np.isfinite(rows.loc[seen, HIDDEN]).all(axis=None), method
        assert rows.loc[~seen, HIDDEN].isna().all(axis=None), method
        assert (rows.loc[~seen, "reason"] != "").all(), method
        assert (rows.loc[seen, STD] > 0.0).all(axis=None), method
        assert not (rows[STD] < 0.0).any(axis=None), method
        assert not np.isinf(rows[["pitch", "depth", *STD]]).any(axis=None), method
    for solution in solved:
        if np.isfinite(solution.covariance).all():
            assert least_eigenvalue(solution) > ROUNDING
        else:
            assert any(np.isnan(craft.polar))
    return found


def later(records: pd.DataFrame, by_s: float) -> pd.DataFrame:
    """Return the records, the clock having jumped half way."""
    time = records["time"].copy()
    half = len(time) // 2
    time.iloc[half:] += pd.Timedelta(seconds=by_s)
    return records.assign(time=time)


def spiked(records: pd.DataFrame) -> pd.DataFrame:
    """Return the records with spikes of 100 m in one sample of fifty."""
    spike = np.where(np.arange(len(records)) % 50 == 17, 100.0, 0.0)
    return records.assign(depth=records["depth"] + spike, pressure=records["pressure"] + spike)


def blanked(*names: str) -> Damage:
    """Return a damage: some columns never reported."""
    return lambda records: records.assign(**dict.fromkeys(names, np.nan))


NOTHING: dict[str, Damage] = {
    "one sample": lambda records: records.iloc[:1],
    "no pitch": blanked("pitch"),
    "no depth": blanked("depth", "pressure"),
    "nothing but NaN": lambda records: records.assign(
        **{name: np.nan for name in records if records[name].dtype == np.float64}
    ),
    "constant depth": lambda records: records.assign(depth=50.0, pressure=50.4),
    "surface only": lambda records: records.assign(depth=0.2, pressure=0.2, phase=np.int8(Phase.SURFACING)),
    "pitch upside down": lambda records: records.assign(pitch=-records["pitch"]),
    "infinite pitch": lambda records: records.assign(pitch=np.inf),
}

SOMETHING: dict[str, Damage] = {
    "one dive": lambda records: records[records["dive"] == 1],
    "dropouts": lambda records: records[np.random.default_rng(0).random(len(records)) > 0.4],
    "a hole": lambda records: pd.concat([records.iloc[:60], records.iloc[110:]]),
    "an hour's gap": lambda records: later(records, 3600.0),
    "three weeks' gap": lambda records: later(records, 21 * 86400.0),
    "clock back": lambda records: later(records, -60.0),
    "records swapped": lambda records: records.iloc[[*range(50), 51, 50, *range(52, len(records))]],
    "spikes of depth": spiked,
    "pitch stuck": lambda records: records.assign(
        pitch=records["pitch"].where(np.arange(len(records)) < 90, records["pitch"].iloc[90])
    ),
    "no density": blanked("density", "temperature", "absolute_salinity", "conservative_temperature"),
    "no temperature": blanked("temperature"),
    "no engine": blanked("buoyancy_volume"),
    "absurd engine": lambda records: records.assign(buoyancy_volume=1e6),
    "engine a hundredfold": lambda records: records.assign(buoyancy_volume=100.0 * records["buoyancy_volume"]),
}


@pytest.mark.parametrize("damage", NOTHING)
def test_where_there_is_nothing_to_know_nothing_is_said(
    flown: Flown, damage: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = survives(NOTHING[damage](flown.records), flown, monkeypatch)
    assert not found.estimates["observable"].any()
    assert found.report["observable_share"] == 0.0


@pytest.mark.parametrize("damage", SOMETHING)
def test_damage_leaves_estimates_that_hold_or_nan(flown: Flown, damage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    records = SOMETHING[damage](flown.records).reset_index(drop=True)
    rows = of_method(survives(records, flown, monkeypatch).estimates, "kinematic")
    seen = rows["observable"].to_numpy()
    assert seen.any()
    if damage in ("one dive", "dropouts", "a hole", "no density", "no temperature", "no engine", "spikes of depth"):
        truth = dives.at(flown, "speed", records["time"])
        far = np.abs(rows["speed"].to_numpy() - truth) > 1.96 * rows["speed_std"].to_numpy()
        assert far[seen].mean() < 0.25


def test_two_samples_have_a_depth_rate_and_no_more_is_made_of_it(flown: Flown, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = survives(flown.records.iloc[40:42], flown, monkeypatch).estimates
    gap = np.abs(rows["speed"] - np.tile(flown.truth["speed"][40:42], 2))
    assert (gap < 3.0 * rows["speed_std"])[rows["observable"]].all()


def test_no_records_at_all(flown: Flown, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(survives(flown.records.iloc[:0], flown, monkeypatch).estimates) == 0


@pytest.mark.parametrize("damage", ["no density", "no engine"])
def test_without_net_buoyancy_there_is_no_force_estimate_and_a_reason(flown: Flown, damage: str) -> None:
    found = estimate(SOMETHING[damage](flown.records), PETREL, flown.mission)
    assert set(found.estimates["method"]) == {"kinematic"}
    assert found.report["force"]["reason"].endswith("no net buoyancy")


def test_spikes_of_depth_do_not_bend_the_force_estimate(flown: Flown, monkeypatch: pytest.MonkeyPatch) -> None:
    clean = of_method(survives(flown.records, flown, monkeypatch).estimates, "force")
    spikes = of_method(survives(spiked(flown.records), flown, monkeypatch).estimates, "force")
    both = (clean["observable"] & spikes["observable"]).to_numpy()
    assert both.mean() > 0.5
    gap = np.abs(spikes["speed"] - clean["speed"])[both] / clean["speed_std"][both]
    assert np.median(gap) < 0.5


def test_a_vehicle_whose_lift_and_drag_are_unknown_has_no_speed_and_the_records_say_why(
    flown: Flown, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare = vehicle.load("bare.yaml", Path(__file__).parents[1])
    found = survives(flown.records, flown, monkeypatch, bare)
    assert not found.estimates["observable"].any()
    assert set(found.estimates["reason"]) == {"lift and drag of the vehicle are not known", "at the surface"}
    assert found.report["force"]["reason"] in (
        "lift and drag of the vehicle are not known",
        "no mass or no density: no net buoyancy",
    )


@pytest.mark.parametrize("name", ["spray", "seaexplorer"])
def test_a_vehicle_whose_lift_and_drag_are_assumed_has_a_speed_with_a_wide_interval_that_holds_and_a_warning(
    flown: Flown, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stds = {}
    for craft in (vehicle.load(name), PETREL):
        found = survives(flown.records, flown, monkeypatch, craft)
        rows = of_method(found.estimates, "kinematic")
        assert rows["observable"].mean() > 0.3
        stds[craft.name] = rows["angle_of_attack_std"].median()
        seen = rows["observable"].to_numpy()
        gap = (rows["speed"].to_numpy() - flown.truth["speed"].to_numpy())[seen]
        assert np.mean(np.abs(gap) < 1.96 * rows["speed_std"].to_numpy()[seen]) > 0.93
        warned = [str(finding) for finding in found.findings if "assumed" in str(finding)]
        assert len(warned) == (craft.name == name)
    assert stds[name] > 1.5 * stds[PETREL.name]


def test_another_vehicle_than_flew_contradicts_but_does_not_fail(flown: Flown, monkeypatch: pytest.MonkeyPatch) -> None:
    """Petrel-II has twice the drag of Seaglider."""
    found = survives(flown.records, flown, monkeypatch, vehicle.load("seaglider"))
    drag = found.report["force"]["parameters"]["parasite_drag"]
    assert drag["value"] > 0.3
    assert drag["verdict"].startswith("contradicts what was known before, by ")


@settings(max_examples=6, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**31),
    lost=st.floats(0.0, 0.95),
    holes=st.integers(0, 4),
    wild=st.sampled_from(["", "depth", "pitch", "buoyancy_volume", "density", "temperature"]),
    jump=st.sampled_from([0.0, 0.0, 200.0, -30.0, 40_000.0]),
)
def test_random_damage_never_breaks_it(
    flown: Flown, monkeypatch: pytest.MonkeyPatch, seed: int, lost: float, holes: int, wild: str, jump: float
) -> None:
    """Samples of each instrument lost at random, stretches of records too, one instrument wild, the clock jumping."""
    rng = np.random.default_rng(seed)
    records = flown.records.copy()
    m = len(records)
    for names in (("depth", "pressure"), ("pitch",), ("density", "temperature"), ("buoyancy_volume",)):
        gone = rng.random(m) < lost * rng.random()
        records.loc[gone, list(names)] = np.nan
    if wild:
        hit = rng.random(m) < 0.05
        records.loc[hit, wild] *= rng.choice([-1.0, 0.5, 2.0]) if wild != "density" else rng.choice([0.97, 1.03])
    kept = np.ones(m, dtype=bool)
    for _ in range(holes):
        first = int(rng.integers(m))
        kept[first : first + int(rng.integers(m // 4))] = False
    kept[int(rng.integers(m))] = True
    survives(later(records[kept], jump), flown, monkeypatch)
