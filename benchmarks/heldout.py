"""Fit the force model on some dives and measure it on the others, both ways, beside the solutions stored in the logs.

Usage: ``python benchmarks/heldout.py DATA [MISSION ...]``, DATA a folder of real logs (default: $SEATRIAL_DATA).

The parameters are adjusted to the depth rate of the odd dives, and the even dives are flown by the adjusted model, and
the other way round; a dive is whole. Printed of the dives left out are

- V *predicted*: by the model from net buoyancy and pitch alone, depth and speed sensor unseen. Depth enters only by the
  density and the compression of the hull, as it does in the stored solutions;
- V *estimated*: the same with the depth of these dives, as stage 2 has it, with the coverage of its 95 % interval;
- w: depth rate measured, upwards, less V sin γ predicted, both over the same 60 s, in steady flight; RMS about zero.
  The stored solution's is made in the same way, at the same instants, from its vertical speed;
- where a propeller drove the vehicle: w of all flight below the surface, by the model and by the same fit without
  thrust. A propeller that never stops in steady flight looks like less drag; when it starts and stops, it does not.

Beside them stand w of the dives fitted on, means of w by direction and depth, and the parameters: where a goal is
missed, they say whether the fit or the change from dive to dive is to blame.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.truth import DEPTHS, Real, asked, in_words, lay_out, score_comet, score_sg171
from pipeline import mission as missions
from pipeline.estimate import flown, force, part, preparation, smoother
from pipeline.estimate.ballast import hull
from pipeline.estimate.compatibility import reconcile
from pipeline.estimate.forcing import forcing
from pipeline.estimate.preparation import Prepared
from pipeline.estimate.series import from_records, powered
from pipeline.ingest import ingest
from pipeline.records import of_method, seconds
from pipeline.roster import resolve_vehicle

#: Missions fitted and measured unless named.
FLOWN = ("comet", "sg171", "sg249", "sg542", "sg167", "sg561", "kolumbo")
#: s over which depth rate and model are averaged before they are compared.
WINDOW = 60
#: m/s that the prediction starts from; a few time constants later nothing of it is left.
START = 0.3
#: The most, cm/s, that the worse of the two directions may have.
GOALS: dict[tuple[str, str], float] = {
    ("comet", "V 12-35 dbar"): 0.82,
    ("comet", "V >= 12 dbar"): 1.15,
    ("sg171", "V"): 4.4,
    ("sg171", "V, fitted with the AD2CP"): 2.7,
    ("sg171", "w"): 1.75,
    ("sg249", "w"): 0.95,
    ("sg542", "w"): 0.85,
    ("sg167", "w"): 1.6,
    ("sg561", "w"): 0.75,
}
#: The most that w with thrust may be of w by the same fit without, of all flight below the surface.
THRUST, SHARE = "w with thrust over w without", 0.8


class NoForceModelError(ValueError):
    """There is no force model of a mission; why."""


class Split(NamedTuple):
    """One direction: records of the dives fitted on, of those measured, and how it is called."""

    name: str
    fitted: pd.DataFrame
    measured: pd.DataFrame


class Water(NamedTuple):
    """w of the model and of the stored solution at the same instants, shape (k,) each, m/s; the latter NaN if none."""

    model: np.ndarray
    stored: np.ndarray
    depth: np.ndarray  # m
    sinking: np.ndarray  # bool


def splits(records: pd.DataFrame) -> Iterator[Split]:
    """Yield odd dives against even ones, and the other way round.

    Parameters
    ----------
    records
        Canonical records of a mission.
    """
    dive = records["dive"].to_numpy()
    odd, even = (records[(dive > 0) & (dive % 2 == rest)].reset_index(drop=True) for rest in (1, 0))
    yield Split("fitted on odd dives, measured on even", odd, even)
    yield Split("fitted on even dives, measured on odd", even, odd)


def what_lacks(real: Real) -> list[str]:
    """Return what the force model of a mission would need and does not have; nothing where it has all.

    Parameters
    ----------
    real
        Mission, vehicle and records.
    """
    records, lacking = real.records, []
    if not records["density"].notna().any():
        lacking.append("no density: needs a CTD, or a key of mission.yaml that gives the water a constant one")
    by_speed = real.vehicle.propeller is not None and records["propeller_speed"].notna().any()
    if powered(records).any() and not by_speed and real.vehicle.disk is None:
        lacking.append("no thrust law for what is logged: needs one in the vehicle file, with 1-sigma")
    return lacking


def without_thrust(real: Real) -> Real:
    """Return a mission whose vehicle has no thrust law, neither by speed nor by power of its propeller."""
    laws = ("thrust_static", "thrust_slope", "propulsive_efficiency")
    kept = {name: one for name, one in real.vehicle.coefficients.items() if name not in laws}
    return real._replace(vehicle=replace(real.vehicle, coefficients=kept))


def fitted(real: Real, records: pd.DataFrame) -> Prepared:
    """Return the force model adjusted to `records`, as stage 2 adjusts it to a mission.

    Parameters
    ----------
    real
        Mission, vehicle and constants of the logs.
    records
        Canonical records of the dives to be fitted on.
    """
    body = hull(real.mission, real.vehicle, real.constants, records)
    stretches = [records.iloc[first:last] for first, last in preparation.windows(len(records))]
    return preparation.prepare(stretches, real.vehicle, real.mission, body)


def predicted(records: pd.DataFrame, prepared: Prepared, *, start: float = START) -> pd.DataFrame:
    """Return speed and path angle that the adjusted force model predicts from pitch and net buoyancy alone.

    Parameters
    ----------
    records
        Canonical records of the dives left out, m rows.
    prepared
        With the adjusted force model.
    start
        Speed, m/s, that the path is linearised along at first.

    Returns
    -------
    pandas.DataFrame
        time; speed, speed_std [m/s]; path_angle [rad]; observable: below the surface; m rows.

    Raises
    ------
    NoForceModelError
        If there is no force model.
    """
    mission, vehicle, body = prepared.mission, prepared.vehicle, prepared.body
    if prepared.adjusted is None or body is None:
        raise NoForceModelError(prepared.reason)
    series = reconcile(records, from_records(records), vehicle, mission).series
    inputs, reason = forcing(records, vehicle, mission, body)
    if inputs is None:
        raise NoForceModelError(reason)
    blind = replace(series, depth=np.full(series.time.size, np.nan))
    along = force.path(blind, np.full(series.time.size, start), series.pitch_guess)
    flight = flown.solve(blind, inputs, prepared.adjusted, along, speed=False, solver=smoother.solve).flight
    return pd.DataFrame(
        {
            "time": records["time"],
            "speed": flight.state[0],
            "speed_std": flight.std[0],
            "path_angle": flight.state[3],
            "observable": ~series.afloat,
        }
    )


def water(
    records: pd.DataFrame, table: pd.DataFrame, stored: pd.DataFrame | None, *, everywhere: bool = False
) -> Water:
    """Return measured depth rate, upwards, less the vertical speed of the model, in steady flight.

    Parameters
    ----------
    records
        Canonical records of the dives left out, m rows.
    table
        As from `predicted`, m rows.
    stored
        Flight solution of the logs (`pipeline.records.STORED`), if there is one.
    everywhere
        Whether all flight below the surface counts, manoeuvres too.
    """
    series = from_records(records)
    steady = ~series.afloat if everywhere else (records["block"].to_numpy() >= 0) & ~series.manoeuvre
    steady &= np.isfinite(series.depth)
    vertical = (table["speed"] * np.sin(table["path_angle"])).to_numpy()
    dive = records["dive"].to_numpy()
    parts = []
    for number in np.unique(dive):
        own = (dive == number) & np.isfinite(series.depth)
        clock = np.arange(series.time[own][0], series.time[own][-1], 1.0)
        if clock.size <= WINDOW:
            continue
        risen = np.interp(clock, series.time[own], -series.depth[own])
        climbed = _sum(np.interp(clock, series.time[dive == number], vertical[dive == number]))
        by_stored = np.full(clock.size, np.nan)
        if stored is not None:
            at = seconds(stored["time"]) - series.start
            by_stored = _sum(np.interp(clock, at, stored["vertical_speed"], left=0.0, right=0.0))
        here = np.flatnonzero((dive == number) & steady)
        inside = (series.time[here] > clock[0] + WINDOW / 2) & (series.time[here] < clock[-1] - WINDOW / 2)
        if stored is not None:
            inside &= (series.time[here] > at[0]) & (series.time[here] < at[-1])
        here = here[inside]
        rate, model, solution = (
            (
                np.interp(series.time[here] + WINDOW / 2, clock, way)
                - np.interp(series.time[here] - WINDOW / 2, clock, way)
            )
            / WINDOW
            for way in (risen, climbed, by_stored)
        )
        parts.append(Water(rate - model, rate - solution, series.depth[here], rate < 0.0))
    return Water(*(np.concatenate(found) for found in zip(*parts, strict=True)))


def _sum(rate: np.ndarray) -> np.ndarray:
    """Return the integral, by trapezia, of a rate given every second."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))])


def rms(value: np.ndarray) -> float:
    """Return the root of the mean square of `value`, shape (k,); NaN if there is none."""
    return float(np.sqrt(np.mean(np.square(value)))) if value.size else float("nan")


def about(name: str, data: Path, raw: Path) -> dict[str, list[float]]:
    """Print what is found on one mission; return the figures that have a goal, cm/s, one a direction.

    Parameters
    ----------
    name
        Of `MISSIONS`.
    data, raw
        Folder of real logs; folder below which the mission is laid out.

    Raises
    ------
    NoForceModelError
        If there is no force model.
    """
    lay_out(data, raw, (name,))
    mission = missions.load(raw / name)
    found = ingest(mission)
    real = Real(mission, resolve_vehicle(mission, found.constants), found.records, found.constants)
    lacking = what_lacks(real)
    if lacking:
        raise NoForceModelError("; ".join(lacking))
    figures: dict[str, list[float]] = {}
    left_out = []
    for split in splits(found.records):
        print(f"{name}, {split.name}")
        prepared = fitted(real, split.fitted)
        table = predicted(split.measured, prepared)
        tables = {"predicted": table}
        if name in ("comet", "sg171"):
            tables["estimated"] = of_method(pd.concat(part.solve(split.measured, prepared).estimates), "force")
        for how, one in tables.items():
            for what, score in speeds(name, data, one).items():
                print(f"    {what}, {how}: {in_words(score)}")
                if how == "predicted":
                    figures.setdefault(what, []).append(100.0 * score["rmse"])
                if "stored_rmse" in score and how == "predicted":
                    print(
                        f"    {what}, stored solution: RMSE {100 * score['stored_rmse']:.2f} cm/s, "
                        f"bias {100 * score['stored_bias']:+.2f} cm/s"
                    )
        if name == "sg171":
            used = real._replace(mission=mission.model_copy(update={"speed_sensor": "use"}))
            taught = fitted(used, split.fitted)._replace(mission=mission)
            score = score_sg171(data, predicted(split.measured, taught))
            print(f"    V, predicted, fitted with the AD2CP of the other dives: {in_words(score)}")
            figures.setdefault("V, fitted with the AD2CP", []).append(100.0 * score["rmse"])
        met = water(split.measured, table, found.stored)
        figures.setdefault("w", []).append(100.0 * rms(met.model))
        left_out.append(met.model)
        print(f"    w, predicted: {_waters(met.model, met)}")
        if found.stored is not None:
            print(f"    w, stored solution: {_waters(met.stored, met)}")
        if powered(found.records).any():
            glide = predicted(split.measured, fitted(without_thrust(real), split.fitted))
            pair = [water(split.measured, flown, None, everywhere=True) for flown in (table, glide)]
            share = rms(pair[0].model) / rms(pair[1].model)
            figures.setdefault(THRUST, []).append(share)
            for how, moved in zip(("with thrust", "by the same fit without"), pair, strict=True):
                print(f"    w of all flight below the surface, {how}: {_waters(moved.model, moved)}")
        seen = water(split.fitted, predicted(split.fitted, prepared), found.stored)
        print(f"    w, predicted, of the dives fitted on: {_waters(seen.model, seen)}")
        for line in parameters(prepared):
            print(f"        {line}")
    print(f"{name}, each dive flown by the fit on the others: w, RMS {100 * rms(np.concatenate(left_out)):.2f} cm/s")
    return figures


def speeds(name: str, data: Path, table: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Return the scores of V where a sensor measured it, by what they are called.

    Parameters
    ----------
    name
        Of the mission.
    data
        Folder of real logs.
    table
        time, speed, speed_std, observable.
    """
    if name == "comet":
        return {f"V {label}": score_comet(data, table, shallow, deep) for shallow, deep, label in DEPTHS}
    return {"V": score_sg171(data, table)} if name == "sg171" else {}


def _waters(value: np.ndarray, met: Water) -> str:
    """Return RMS of w and its means where the vehicle sinks and rises, in the upper half of the depths and below."""
    middle = 0.5 * (met.depth.min() + met.depth.max())
    means = []
    for way, moving in (("sinking", met.sinking), ("rising", ~met.sinking)):
        for where, there in ((f"above {middle:.0f} m", met.depth < middle), ("below", met.depth >= middle)):
            some = value[moving & there]
            means.append(f"{way} {where} {100 * some.mean():+.2f}" if some.size else f"{way} {where} none")
    return f"RMS {100 * rms(value):.2f} cm/s, mean {100 * value.mean():+.2f} (n {value.size}); " + ", ".join(means)


def parameters(prepared: Prepared) -> Iterator[str]:
    """Yield what the fit found of each parameter that it may adjust.

    Parameters
    ----------
    prepared
        With the adjusted force model.
    """
    if prepared.adjusted is None:
        return
    report = prepared.adjusted.report
    if not report["converged"]:
        yield "the fit has not converged"
    for name, one in report["parameters"].items():
        if not one["verdict"].startswith("considered"):
            yield (
                f"{name}: {one['value']:.3g} +- {one['std']:.2g}, before {one['before']:.3g} +- {one['std_before']:.2g}"
                f": {one['verdict']}"
            )


def main() -> int:
    """Print a paragraph for each mission, then a verdict on each goal; return 1 if one is missed, 2 without data."""
    meant = asked(FLOWN)
    return 2 if meant is None else verdict(*meant)


def verdict(data: Path, names: tuple[str, ...] = FLOWN) -> int:
    """Print a paragraph for each mission, then a verdict on each goal; return 1 if one is missed.

    Parameters
    ----------
    data
        Folder of real logs.
    names
        Missions, of `MISSIONS`.
    """
    verdicts = []
    with tempfile.TemporaryDirectory() as scratch:
        for name in names:
            try:
                figures = about(name, data, Path(scratch))
            except NoForceModelError as error:
                print(f"{name}: no force model: {error}")
                verdicts.append((False, f"{name}: cannot be had: {error}"))
                continue
            if THRUST in figures:
                both = " and ".join(f"{one:.2f}" for one in figures[THRUST])
                verdicts.append((max(figures[THRUST]) <= SHARE, f"{name}, {THRUST}: {both}, at most {SHARE:g}"))
            for (mission, what), most in GOALS.items():
                if mission == name:
                    worse = max(figures[what])
                    both = " and ".join(f"{one:.2f}" for one in figures[what])
                    verdicts.append((worse <= most, f"{name}, {what}: RMS {both} cm/s, at most {most:g}"))
    print()
    for passed, text in verdicts:
        print(f"{'PASS' if passed else 'FAIL'}  {text}")
    return 0 if all(passed for passed, _ in verdicts) else 1


if __name__ == "__main__":
    raise SystemExit(main())
