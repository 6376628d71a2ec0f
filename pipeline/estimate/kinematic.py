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

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import minimize

from pipeline.estimate import smoother
from pipeline.estimate.legs import legs
from pipeline.estimate.linearise import (
    CRUISE,
    DEPTH,
    PITCH,
    SLIP,
    SPEED,
    WATER,
    Settings,
    Trajectory,
    linearise,
)
from pipeline.estimate.series import Series, from_records
from pipeline.estimate.smoother import Problem, Solution
from pipeline.estimate.verdict import consistency, coverage, verdict
from pipeline.findings import Finding, nearest
from pipeline.mission import Mission
from pipeline.model.closure import glide_angles
from pipeline.vehicle import Polar, Vehicle

#: A measurement farther than this many standard deviations from the smoothed trajectory is left out.
GATE = 6.0
ENGINES = ("numba", "filterpy")
#: What is found by likelihood, with the 1-sigma of the logarithm around its value in `Settings`.
SEARCHED = {"sigma_w": 0.3, "depth_noise": 1.0, "swell": 2.0}
#: Depth alone cannot show water stiller than this (m/s): a slow change of V looks the same.
STILL = 0.009
#: Nor is its own noise (m) believed below this.
QUIET = 0.005
#: The likelihood is searched on at most this many records.
SEARCH_RECORDS = 20_000


@dataclass(frozen=True)
class Estimated:
    """What the estimator hands on: the canonical estimates, what they rest on, and what was doubted."""

    estimates: pd.DataFrame
    report: dict[str, Any]
    findings: list[Finding]


class _Options(NamedTuple):
    """What does not change between iterations."""

    use_speed: bool
    use_fixes: bool
    solve: Callable[[Problem], Solution]


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
    options = _Options(mission.speed_sensor == "use", mission.gps == "use" and series.located, solve)
    findings: list[Finding] = []
    polar = vehicle.polar
    settings = _noise_from(series)
    start = first_guess(series, polar)
    at, _ = _iterate(series, polar, settings, start, options, 2)
    settings = _likeliest(series, polar, settings, at, options)
    at, solution = _iterate(series, polar, settings, at, options, 4)
    gated = _gate(series, settings, solution, findings)
    at, solution = _iterate(gated, polar, settings, at, options, 6)
    spread = _left_open(gated, vehicle, mission, settings, at, solution, options)
    estimates, report = _tabulate(records, gated, polar, solution, spread, options)
    report["settings"] = asdict(settings) | {"engine": engine, "pitch_std_deg": mission.pitch.std_deg}
    report["used"] = {"speed_sensor": options.use_speed, "fixes": options.use_fixes}
    return Estimated(estimates, report, findings)


def first_guess(series: Series, polar: Polar) -> Trajectory:
    """Return a trajectory to linearise along: V from the smoothed depth rate, where the path is steep enough."""
    m = series.time.size
    speed = np.full(m, 0.4)
    for _ in range(3 if polar.drag_exponent else 1):
        alpha, _, _, steady = glide_angles(polar, speed, series.pitch_guess)
        sine = np.sin(series.pitch_guess - _share(series) * alpha)
        good = steady & (np.abs(sine) > 0.15) & ~series.manoeuvre
        ratio = np.where(good, -series.depth_rate_guess / np.where(good, sine, 1.0), np.nan)
        good &= (ratio > 0.03) & (ratio < 3.0)
        if not good.any():
            break
        speed = np.interp(series.time, series.time[good], ratio[good])
    return Trajectory(speed, series.pitch_guess, np.zeros(m))


def _iterate(
    series: Series,
    polar: Polar,
    settings: Settings,
    at: Trajectory,
    options: _Options,
    times: int,
    pitch_shift: float = 0.0,
) -> tuple[Trajectory, Solution]:
    """Linearise and solve until the trajectory stands still, at most `times` times."""
    for _ in range(times):
        problem = linearise(
            series,
            polar,
            settings,
            at,
            use_speed=options.use_speed,
            use_fixes=options.use_fixes,
            pitch_shift=pitch_shift,
        )
        solution = options.solve(problem)
        speed = np.clip(_speed(series, solution)[0], 0.02, 4.0)
        pitch = np.clip(solution.mean[:, PITCH], -1.5, 1.5)
        slip = np.clip(solution.mean[:, SLIP], -0.3, 0.3)
        change = float(np.max(np.abs(speed - at.speed)))
        at = Trajectory(speed, pitch, slip)
        if change < 1e-7:
            break
    return at, solution


def _speed(series: Series, solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Return V and the state that it is at each instant (SPEED or CRUISE), shape (m,) each."""
    n = solution.mean.shape[1]
    state = np.where(series.cruising & (n > CRUISE), min(CRUISE, n - 1), SPEED)
    return np.take_along_axis(solution.mean, state[:, None], axis=1)[:, 0], state


def _share(series: Series) -> np.ndarray:
    """Return the expected share of the glide's angle of attack: all of it, none under power; shape (m,)."""
    return np.where(series.powered, 0.0, 1.0)


def _noise_from(series: Series) -> Settings:
    """Return settings with the sensors' noise read off the high-frequency part of their own records."""
    depth_noise, _ = _noise_and_drift(series.time, series.depth, ~series.manoeuvre)
    pitch_noise, pitch_drift = _noise_and_drift(series.time, series.pitch, ~series.manoeuvre)
    return replace(
        Settings(),
        depth_noise=float(np.clip(depth_noise, 0.01, 1.0)),
        pitch_noise=float(np.clip(pitch_noise, np.radians(0.05), np.radians(2.0))),
        pitch_drift=float(np.clip(pitch_drift, np.radians(0.01) ** 2, np.radians(0.5) ** 2)),
    )


def _noise_and_drift(time: np.ndarray, value: np.ndarray, where: np.ndarray) -> tuple[float, float]:
    """Return the 1-sigma of white noise and the random-walk intensity of a series with a linear trend.

    From third differences (a cubic cancels; 20 σ² for white noise) and from second differences over eight samples,
    both by their median absolute value.
    """
    known = np.isfinite(value) & where
    x, t = value[known], time[known]
    if x.size < 40:
        return 0.0, 0.0
    third = np.diff(x, 3)
    noise = float(np.median(np.abs(third))) / 0.6745 / np.sqrt(20.0)
    lag = 8
    bend = x[2 * lag :] - 2.0 * x[lag:-lag] + x[: -2 * lag]
    span = float(np.median(t[lag:] - t[:-lag]))
    total = (float(np.median(np.abs(bend))) / 0.6745) ** 2
    return noise, max(total - 6.0 * noise**2, 0.0) / max(2.0 * span, 1e-3)


def _likeliest(series: Series, polar: Polar, settings: Settings, at: Trajectory, options: _Options) -> Settings:
    """Return settings with the σ of w_w, swell, noise and drift at the maximum of likelihood times prior.

    How much of the slow change of depth rate is the water's and how much is V's, the likelihood hardly says, so σ of
    w_w is not believed below `STILL`: intervals then hold either way.
    """
    names = list(SEARCHED)
    median = np.log([getattr(settings, name) for name in names])
    spread = np.array([SEARCHED[name] for name in names])
    part = slice(0, SEARCH_RECORDS)
    short = Series(**{key: value[part] for key, value in vars(series).items()})
    along = Trajectory(*(value[part] for value in at))

    def cost(u: np.ndarray) -> float:
        trial = replace(settings, **dict(zip(names, np.exp(median + spread * u).tolist(), strict=True)))
        problem = linearise(short, polar, trial, along, use_speed=options.use_speed, use_fixes=False)
        return 0.5 * float(u @ u) - smoother.log_likelihood(problem)

    simplex = np.vstack([np.zeros(len(names)), np.eye(len(names))])
    best = minimize(
        cost,
        simplex[0],
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": 200, "xatol": 0.05, "fatol": 0.1},
    )
    found = dict(zip(names, np.exp(median + spread * best.x).tolist(), strict=True))
    found |= {"sigma_w": max(found["sigma_w"], STILL), "depth_noise": max(found["depth_noise"], QUIET)}
    return replace(settings, **found)


def _gate(series: Series, settings: Settings, solution: Solution, findings: list[Finding]) -> Series:
    """Return the series without the measurements that the smoothed trajectory contradicts; list what was left out."""
    changed = {}
    for name, state, noise in (
        ("depth", DEPTH, settings.depth_noise),
        ("pitch", PITCH, settings.pitch_noise),
    ):
        value = getattr(series, name)
        sigma = np.sqrt(noise**2 + solution.covariance[:, state, state])
        with np.errstate(invalid="ignore"):
            far = np.abs(value - solution.mean[:, state]) > GATE * sigma
        if far.any():
            first = float(series.time[np.argmax(far)])
            findings.append(
                Finding(
                    "warning",
                    f"{name} record",
                    f"{int(far.sum())} of {int(np.isfinite(value).sum())} samples, the first {first:.0f} s in",
                    f"values more than {GATE:g} standard deviations from the smoothed trajectory",
                    "values within",
                    "left out of the estimate",
                )
            )
            changed[name] = np.where(far, np.nan, value)
    return replace(series, **changed)


def _left_open(
    series: Series,
    vehicle: Vehicle,
    mission: Mission,
    settings: Settings,
    at: Trajectory,
    solution: Solution,
    options: _Options,
) -> dict[str, np.ndarray]:
    """Return the change of (V, θ, α, γ, w) when each borrowed coefficient and the pitch bias moves by 1-sigma."""
    base = _angles(series, vehicle.polar, solution)

    def moved(polar: Polar, pitch_shift: float) -> np.ndarray:
        _, other = _iterate(series, polar, settings, at, options, 2, pitch_shift)
        return np.asarray(_angles(series, polar, other) - base)

    bias = float(np.radians(mission.pitch.std_deg))
    changes = {"pitch": 0.5 * (moved(vehicle.polar, bias) - moved(vehicle.polar, -bias))}
    for name in ("lift_slope", "parasite_drag", "induced_drag", "lift_at_zero"):
        step = vehicle.std(name)
        if step > 0.0:
            value = getattr(vehicle.polar, name) + step
            changes[name] = moved(vehicle.polar._replace(**{name: value}), 0.0)
    return changes


def _angles(series: Series, polar: Polar, solution: Solution) -> np.ndarray:
    """Return V, θ, α, γ and w_w of smoothed states, shape (5, m)."""
    speed, _ = _speed(series, solution)
    pitch = solution.mean[:, PITCH]
    glide, _, _, _ = glide_angles(polar, np.clip(speed, 0.02, 4.0), pitch)
    alpha = _share(series) * glide + solution.mean[:, SLIP]
    return np.stack([speed, pitch, alpha, pitch - alpha, solution.mean[:, WATER]])


def _tabulate(
    records: pd.DataFrame,
    series: Series,
    polar: Polar,
    solution: Solution,
    spread: dict[str, np.ndarray],
    options: _Options,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Return the canonical estimates and the report on them."""
    speed, pitch, alpha, path, water = _angles(series, polar, solution)
    P = solution.covariance
    row = np.arange(speed.size)
    _, state = _speed(series, solution)
    _, by_pitch, by_speed, steady = glide_angles(polar, np.clip(speed, 0.02, 4.0), pitch)
    share = _share(series)
    to_alpha = np.zeros((speed.size, P.shape[1]))
    to_alpha[row, state], to_alpha[:, PITCH], to_alpha[:, SLIP] = share * by_speed, share * by_pitch, 1.0
    to_path = -to_alpha
    to_path[:, PITCH] += 1.0
    random = np.stack(
        [
            P[row, state, state],
            P[:, PITCH, PITCH],
            np.einsum("ki,kij,kj->k", to_alpha, P, to_alpha),
            np.einsum("ki,kij,kj->k", to_path, P, to_path),
            P[:, WATER, WATER],
        ]
    )
    total = np.sqrt(np.maximum(random, 0.0) + sum(change**2 for change in spread.values()))
    reason = verdict(series, speed, total[0], steady, depth_alone=not (options.use_speed or options.use_fixes))
    seen = reason == ""
    hidden = np.where(seen, 1.0, np.nan)
    estimates = pd.DataFrame(
        {
            "time": records["time"],
            "dive": records["dive"],
            "method": "kinematic",
            "speed": speed * hidden,
            "speed_std": total[0] * hidden,
            "path_angle": path * hidden,
            "path_angle_std": total[3] * hidden,
            "angle_of_attack": alpha * hidden,
            "angle_of_attack_std": total[2] * hidden,
            "pitch": pitch,
            "pitch_std": total[1],
            "depth": solution.mean[:, DEPTH],
            "depth_std": np.sqrt(P[:, DEPTH, DEPTH]),
            "vertical_water_velocity": water * hidden,
            "vertical_water_velocity_std": total[4] * hidden,
            "observable": seen,
            "reason": reason,
        }
    )
    report: dict[str, Any] = {
        "observable_share": float(seen.mean()),
        "reasons": {str(text): int((reason == text).sum()) for text in np.unique(reason) if text},
        "consistency": consistency(solution, series),
        "coverage": coverage(series, speed, total[0], seen),
        "gps": legs(series, speed, total[0], solution.mean, seen) if P.shape[1] > CRUISE else None,
        "share_of_variance": {
            name: float(np.mean((change[0] ** 2 / total[0] ** 2)[seen])) if seen.any() else None
            for name, change in spread.items()
        },
    }
    return estimates, report
