"""Speed through water and angle of attack from depth and pitch, borrowing only the ratio of lift to drag.

State V, θ, z, w_w and δ, where α = α_closure(θ, V) + δ: the polar closure gives the angle of attack of an unpowered
steady glide, and δ, a Gauss–Markov process, says how far it may be off: little in steady flight, more in
manoeuvres. Under power the closure is not borrowed: α = δ, with the glide's α as its span. Depth obeys
ż = −V sin(θ − α) − w_w. Where there are fixes and a heading, position, current and the speed of powered level
flight join the state, so that the displacement between fixes carries the speed that depth cannot. Net buoyancy,
thrust and propeller speed never enter, and a common factor on all coefficients changes nothing.

The problem is linearised along the smoothed trajectory and solved again until that stands still (iterated
extended Kalman smoother; Bell 1994, doi:10.1137/0804035). What the coefficients and the pitch bias leave open
is added as the change of the result when each is moved by its 1-sigma.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pipeline.estimate import smoother
from pipeline.estimate.legs import legs
from pipeline.estimate.linearise import CRUISE, CURRENT_EAST, DEPTH, PITCH, SLIP, WATER, Settings, Trajectory
from pipeline.estimate.noise import likeliest, noise_from
from pipeline.estimate.series import Series, from_records
from pipeline.estimate.smoother import Solution
from pipeline.estimate.trajectory import Options, angles, first_guess, iterate, share_of_glide, speed_of
from pipeline.estimate.verdict import consistency, coverage, verdict
from pipeline.findings import Finding, nearest
from pipeline.mission import Mission
from pipeline.model.closure import glide_angles
from pipeline.records import ESTIMATES, conform
from pipeline.vehicle import Polar, Vehicle

ENGINES = ("numba", "filterpy")
#: A measurement farther than this many standard deviations from the smoothed trajectory is left out.
GATE = 6.0
#: Noise levels are searched on at most this many records.
SEARCH_RECORDS = 20_000
#: A mission is solved in parts of about this many records, cut at the surface, so that memory does not grow with it.
PART_RECORDS = 100_000


@dataclass(frozen=True)
class Estimated:
    """What the estimator hands on: the canonical estimates, what they rest on, and what was doubted."""

    estimates: pd.DataFrame
    report: dict[str, Any]
    findings: list[Finding]


class _Part(NamedTuple):
    """A part of a mission, solved; the last axis counts its k instants."""

    state: np.ndarray  # (5, k): V, θ, α, γ, w_w
    std: np.ndarray  # (5, k)
    depth: np.ndarray  # (2, k): depth and its 1-sigma
    current: np.ndarray  # (2, k): east and north, NaN without fixes
    steady: np.ndarray  # (k,): steep enough for a glide
    innovation: np.ndarray  # (2, k): of depth and pitch, normalised
    outlying: np.ndarray  # (2, k): depth and pitch left out
    borrowed: np.ndarray  # (names, k): change of V with each of `BORROWED`


#: What the estimate borrows, besides the pitch as logged; each is moved by its 1-sigma.
BORROWED = ("pitch", "lift_slope", "parasite_drag", "induced_drag", "lift_at_zero")


def estimate(records: pd.DataFrame, vehicle: Vehicle, mission: Mission, *, engine: str = "numba") -> Estimated:
    """Return speed through water, angle of attack, path angle and vertical water velocity with their 1-sigma.

    Parameters
    ----------
    records
        Canonical records, one row per instant.
    vehicle
        Its polar is borrowed (ratios of coefficients only).
    mission
        Whether a speed sensor and fixes are used, and the 1-sigma of the pitch bias.
    engine
        ``numba``, or ``filterpy`` for the same linear problems by an independent implementation.

    Returns
    -------
    Estimated
        Estimates at every record; an unobservable speed is NaN with a reason.

    Raises
    ------
    ValueError
        If `engine` is not known.
    """
    if engine not in ENGINES:
        raise ValueError(f"engine: found '{engine}'; {nearest(engine, list(ENGINES))}")
    if engine == "filterpy":
        from pipeline.estimate.reference import solve
    else:
        solve = smoother.solve
    series = from_records(records)
    options = Options(mission.speed_sensor == "use", mission.gps == "use" and series.located, solve)
    start = series[: min(SEARCH_RECORDS, series.time.size)]
    settings = noise_from(start)
    at, _ = iterate(start, vehicle.polar, settings, first_guess(start, vehicle.polar), options, 2)
    settings = likeliest(start, vehicle.polar, settings, at, options.use_speed)
    parts = [_solve(series[first:last], vehicle, mission, settings, options) for first, last in cuts(series.surfaced)]
    whole = _Part(*(np.concatenate(pieces, axis=-1) for pieces in zip(*parts, strict=True)))
    estimates, report = _tabulate(records, series, whole, options)
    report["settings"] = asdict(settings) | {"engine": engine, "pitch_std_deg": mission.pitch.std_deg}
    report["used"] = {"speed_sensor": options.use_speed, "fixes": options.use_fixes}
    return Estimated(estimates, report, _left_out(series, whole.outlying))


def cuts(surfaced: np.ndarray, size: int = PART_RECORDS) -> list[tuple[int, int]]:
    """Return where a mission is cut into parts of about `size` records: at the surface if it is met near there.

    Parameters
    ----------
    surfaced
        Where the vehicle is at the surface, shape (m,).
    size
        Records in a part; the cut is moved by at most half of it.
    """
    m = surfaced.size
    bounds = [0]
    while m - bounds[-1] > 1.5 * size:
        aim = bounds[-1] + size
        near = np.flatnonzero(surfaced[aim - size // 2 : aim + size // 2]) + aim - size // 2
        bounds.append(int(near[np.argmin(np.abs(near - aim))]) if near.size else aim)
    return list(pairwise([*bounds, m]))


def _solve(series: Series, vehicle: Vehicle, mission: Mission, settings: Settings, options: Options) -> _Part:
    """Return a part of the mission solved: iterated, outliers left out, with what the coefficients leave open."""
    polar = vehicle.polar
    at, solution = iterate(series, polar, settings, first_guess(series, polar), options, 4)
    outlying = _outlying(series, settings, solution)
    series = replace(
        series,
        depth=np.where(outlying[0], np.nan, series.depth),
        pitch=np.where(outlying[1], np.nan, series.pitch),
    )
    at, solution = iterate(series, polar, settings, at, options, 6)
    changes = _left_open(series, vehicle, mission, settings, at, solution, options)
    random, steady = _random_variance(series, polar, solution)
    n = solution.mean.shape[1]
    currents = slice(CURRENT_EAST, CURRENT_EAST + 2)
    return _Part(
        state=angles(series, polar, solution),
        std=np.sqrt(random + np.sum(changes**2, axis=0)),
        depth=np.stack([solution.mean[:, DEPTH], np.sqrt(solution.covariance[:, DEPTH, DEPTH])]),
        current=solution.mean[:, currents].T if n > CRUISE else np.full((2, series.time.size), np.nan),
        steady=steady,
        innovation=(solution.innovation[:, :2] / np.sqrt(solution.innovation_variance[:, :2])).T,
        outlying=outlying,
        borrowed=changes[:, 0],
    )


def _outlying(series: Series, settings: Settings, solution: Solution) -> np.ndarray:
    """Return where the smoothed trajectory contradicts depth and pitch, boolean of shape (2, m)."""
    far = []
    for value, state, noise in (
        (series.depth, DEPTH, settings.depth_noise),
        (series.pitch, PITCH, settings.pitch_noise),
    ):
        sigma = np.sqrt(noise**2 + solution.covariance[:, state, state])
        with np.errstate(invalid="ignore"):
            far.append(np.abs(value - solution.mean[:, state]) > GATE * sigma)
    return np.stack(far)


def _left_out(series: Series, outlying: np.ndarray) -> list[Finding]:
    """Return a finding for each instrument some of whose measurements were left out."""
    return [
        Finding(
            "warning",
            f"{name} record",
            f"{int(far.sum())} of {int(np.isfinite(value).sum())} samples, "
            f"the first {float(series.time[np.argmax(far)]):.0f} s in",
            f"values more than {GATE:g} standard deviations from the smoothed trajectory",
            "values within",
            "left out of the estimate",
        )
        for name, value, far in zip(("depth", "pitch"), (series.depth, series.pitch), outlying, strict=True)
        if far.any()
    ]


def _left_open(
    series: Series,
    vehicle: Vehicle,
    mission: Mission,
    settings: Settings,
    at: Trajectory,
    solution: Solution,
    options: Options,
) -> np.ndarray:
    """Return the change of V, θ, α, γ, w_w when each of `BORROWED` moves by 1-sigma, shape (names, 5, m)."""
    base = angles(series, vehicle.polar, solution)

    def moved(polar: Polar, pitch_shift: float) -> np.ndarray:
        _, other = iterate(series, polar, settings, at, options, 1, pitch_shift)
        return np.asarray(angles(series, polar, other) - base)

    bias = float(np.radians(mission.pitch.std_deg))
    changes = [0.5 * (moved(vehicle.polar, bias) - moved(vehicle.polar, -bias))]
    for name in BORROWED[1:]:
        step = vehicle.std(name)
        if step > 0.0:
            value = getattr(vehicle.polar, name) + step
            changes.append(moved(vehicle.polar._replace(**{name: value}), 0.0))
        else:
            changes.append(np.zeros_like(base))
    return np.stack(changes)


def _random_variance(series: Series, polar: Polar, solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Return the smoother's own variance of V, θ, α, γ, w_w, shape (5, m), and where the pitch is steep enough."""
    P = solution.covariance
    row = np.arange(series.time.size)
    speed, state = speed_of(series, solution)
    _, by_pitch, by_speed, steady = glide_angles(polar, np.clip(speed, 0.02, 4.0), solution.mean[:, PITCH])
    share = share_of_glide(series)
    to_alpha = np.zeros((row.size, P.shape[1]))
    to_alpha[row, state], to_alpha[:, PITCH], to_alpha[:, SLIP] = share * by_speed, share * by_pitch, 1.0
    to_path = -to_alpha
    to_path[:, PITCH] += 1.0
    variance = [
        P[row, state, state],
        P[:, PITCH, PITCH],
        np.einsum("ki,kij,kj->k", to_alpha, P, to_alpha),
        np.einsum("ki,kij,kj->k", to_path, P, to_path),
        P[:, WATER, WATER],
    ]
    return np.maximum(np.stack(variance), 0.0), steady


def _tabulate(
    records: pd.DataFrame, series: Series, whole: _Part, options: Options
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Return the canonical estimates and the report on them."""
    speed, speed_std = whole.state[0], whole.std[0]
    depth_alone = not (options.use_speed or options.use_fixes)
    reason = verdict(series, speed, speed_std, whole.steady, depth_alone=depth_alone)
    seen = reason == ""
    table: dict[str, Any] = {"time": records["time"], "dive": records["dive"], "method": "kinematic"}
    names = ("speed", "pitch", "angle_of_attack", "path_angle", "vertical_water_velocity")
    for name, value, std in zip(names, whole.state, whole.std, strict=True):
        shown = np.where(seen | (name == "pitch"), 1.0, np.nan)
        table |= {name: value * shown, f"{name}_std": std * shown}
    table |= {"depth": whole.depth[0], "depth_std": whole.depth[1], "observable": seen, "reason": reason}
    report: dict[str, Any] = {
        "observable_share": float(seen.mean()),
        "reasons": {str(text): int((reason == text).sum()) for text in np.unique(reason) if text},
        "consistency": consistency(whole.innovation, series),
        "coverage": coverage(series, speed, speed_std, seen),
        "gps": legs(series, speed, speed_std, whole.current, seen) if options.use_fixes else None,
        "share_of_variance": {
            name: float(np.mean((change**2 / speed_std**2)[seen])) if seen.any() else None
            for name, change in zip(BORROWED, whole.borrowed, strict=True)
            if change.any()
        },
    }
    return conform(pd.DataFrame(table), ESTIMATES), report
