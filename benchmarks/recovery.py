"""Simulated campaigns in which one thing is wrong: how often it is found, and said where it cannot be told.

Usage: ``python benchmarks/recovery.py [CAMPAIGNS [FIRST]] [--draws N] [--json]``: campaigns (default 100, numbers from
0), on all cores. In turn nothing is injected, +21 % of K_D0, thrust times 0.8, 0.3 N of buoyancy, 1° of pitch bias, or
15 mm of battery position. Every campaign is flown by the simulator, with a vehicle of its own that is drawn around the
one of the file with the stated 1-sigma (its thrust law with one factor), logged, read and averaged by the pipeline,
fitted and ranked.

Whether a campaign can tell its cause is decided before it is flown, from the information matrix of its orders alone:
the expected difference in χ² between the cause and its nearest rival, or nothing, is at least `CAN`, or at most
`CANNOT`. Orders between the two are drawn again. Half of the vehicles are as published; the others as an earlier
mission has left them, with the 1-sigma of `CALIBRATED`: what a vehicle file leaves open by 10 % no data show to be
21 % off.

Beside the campaigns, block means are drawn many times for the same orders, by the theory and the stated covariance:
coverage and the scatter over the Cramér–Rao bound, without simulator and pipeline.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.fleet import Flight, complete, fly, perturbed, spread, standard_normal, used, vehicles
from pipeline import vehicle, workers
from pipeline.estimate.stage import InMemory, Summary, stream
from pipeline.model.closure import glide_angle
from pipeline.model.forces import GRAVITY
from pipeline.model.steady import trim_at_pitch
from pipeline.plan import Plan, Stage, Water
from pipeline.records import BLOCKS, conform, timestamps
from pipeline.report.covariance import Whitener
from pipeline.report.fitting.causes import CAUSES
from pipeline.report.fitting.evidence import Prior, information, posterior, separation, stated, with_cause
from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.hypotheses import rank
from pipeline.report.fitting.judgement import NOTHING
from pipeline.report.fitting.observations import BatteryPositions, observe
from pipeline.report.fitting.regression import LOST, Problem
from pipeline.report.fitting.sea import sea
from pipeline.report.fitting.terms import DepthRates
from pipeline.simulate import Injection
from pipeline.vehicle import Vehicle

#: Expected difference in χ² to the nearest rival from which a campaign can tell its cause, and up to which it cannot.
CAN, CANNOT = 25.0, 1.3
#: What is injected, in turn; the sign of the last three is drawn.
INJECTED = (NOTHING, "sensor drag", "thrust loss", "buoyancy error", "pitch bias", "battery trim")
DRAG, THRUST, BUOYANCY, PITCH_DEG, BATTERY = 0.21, 0.8, 0.3, 1.0, 0.015
#: 1-sigma of a vehicle that an earlier mission has calibrated, relative; of the battery's position without moment, m.
CALIBRATED = {
    "parasite_drag": 0.02,
    "lift_slope": 0.05,
    "induced_drag": 0.08,
    "thrust_static": 0.02,
    "thrust_slope": 0.02,
    "moment_at_zero": 0.05,
    "moment_slope": 0.05,
    "mass_forward": 0.01,
    "mass_normal": 0.01,
    "righting_moment": 0.05,
    "battery_mass": 0.02,
    "compressibility": 0.02,
    "thermal_expansion": 0.05,
}
NEUTRAL_STD = 0.001
#: Length of the blocks, and what a leg loses to turning, s; time between dives, s.
BLOCK_S, TURNING_S, AFLOAT_S = 300.0, 90.0, 240.0
#: Tries to draw orders of the class that is wanted.
TRIES = 400
BOUND = 1.96


@dataclass(frozen=True)
class Leg:
    """Orders of one dive and its climb: pitch [deg], net buoyancy [N], propeller [rpm] in each."""

    pitch: float
    force: float
    rpm_down: float
    rpm_up: float


@dataclass(frozen=True)
class Campaign:
    """A campaign before it is flown.

    Attributes
    ----------
    number
        What everything follows from.
    cause
        What is injected, of `INJECTED`, and its true change of the unknown, in its unit.
    craft
        The vehicle as in its file.
    legs, depth
        One a dive, and how deep, m.
    water
        σ_w [m/s] and τ_w [s].
    ballast_std, pitch_std_deg
        As the mission states them.
    separation
        Expected difference in χ² to the nearest rival; NaN where nothing is injected.
    """

    number: int
    cause: str
    change: float
    craft: Vehicle
    legs: tuple[Leg, ...]
    depth: float
    water: tuple[float, float]
    ballast_std: float
    pitch_std_deg: float
    separation: float = math.nan

    @property
    def kind(self) -> str:
        """``none``, ``can`` or ``cannot`` be told."""
        if self.cause == NOTHING:
            return "none"
        return "can" if self.separation >= CAN else "cannot"

    @property
    def settings(self) -> dict[str, float]:
        """The true strength and correlation time of the water, as the estimator reports its own."""
        return {"sigma_w": self.water[0], "tau_w": self.water[1]}

    def given(self, settings: Mapping[str, Any]) -> Given:
        """Return what fit and ranking are given, in water of these settings."""
        return Given(settings, self.ballast_std, math.radians(self.pitch_std_deg))


def campaign(number: int) -> Campaign:
    """Return the campaign with this number: its cause in turn, its class in turn, its orders drawn."""
    rng = np.random.default_rng([number, 0x2EC0])
    cause = INJECTED[number % len(INJECTED)]
    wanted = "none" if cause == NOTHING else ("can", "cannot")[number // len(INJECTED) % 2]
    for _ in range(TRIES):
        drawn = _drawn(number, cause, wanted, rng)
        if drawn.cause != NOTHING:
            drawn = replace(drawn, separation=expected(drawn))
            if CANNOT < drawn.separation < CAN:
                continue
        if drawn.kind == wanted:
            return drawn
    raise ValueError(f"campaign {number}: no orders found in {TRIES} tries that {wanted} tell {cause}")


def expected(planned: Campaign) -> float:
    """Return the expected difference in χ² between the cause and its nearest rival or nothing, from the orders."""
    observed = _observed(planned, planned_blocks(planned))
    unknowns = {one.name: one.unknown for one in CAUSES}
    names = [name for name in unknowns.values() if name in observed.model.names]
    if unknowns[planned.cause] not in names:
        return 0.0
    columns = [observed.model.names.index(name) for name in names]
    seen = information(observed, stated(observed), columns)
    first = names.index(unknowns[planned.cause])
    rivals = [None, *(i for i in range(len(columns)) if i != first)]
    return min(separation(seen, first, rival, planned.change) for rival in rivals)


def planned_blocks(planned: Campaign) -> pd.DataFrame:
    """Return the steady blocks to be expected of the orders, by the vehicle of the file in still water."""
    craft = planned.craft
    clock = 0.0
    rows: list[dict[str, Any]] = []
    for dive, leg in enumerate(planned.legs, 1):
        for side, rpm in ((-1, leg.rpm_down), (1, leg.rpm_up)):
            pitch, force = side * math.radians(leg.pitch), side * leg.force
            trim = trim_at_pitch(craft, force, pitch, propeller_speed=rpm / 60.0)
            rate = float(-trim.speed * np.sin(trim.path_angle))
            steady = max(planned.depth / abs(rate) - TURNING_S, 1.0)
            count = math.ceil(steady / BLOCK_S)
            for k in range(count):
                begin = clock + TURNING_S + k * steady / count
                rows.append(
                    {
                        "block": len(rows),
                        "start": begin,
                        "end": begin + steady / count,
                        "dive": dive,
                        "direction": side,
                        "powered": rpm > 0.0,
                        "used": True,
                        "pitch": pitch,
                        "net_buoyancy": force,
                        "propeller_speed": rpm / 60.0,
                        "depth_rate": rate,
                        "depth_rate_std": 2e-4,
                        "battery_position": 0.0,
                        "battery_position_std": 5e-4,
                        "density": craft["reference_density"],
                        "roll": 0.0,
                    }
                )
            clock += steady + TURNING_S
        clock += AFLOAT_S
    frame = pd.DataFrame(rows)
    times = {name: timestamps(1.6e9 + frame[name].to_numpy()) for name in ("start", "end")}
    return conform(frame.assign(**times), BLOCKS)


def _observed(planned: Campaign, blocks: pd.DataFrame) -> Problem:
    return observe(blocks, planned.craft, planned.given(planned.settings))


def _drawn(number: int, cause: str, wanted: str, rng: np.random.Generator) -> Campaign:
    """Return orders drawn at random, such as often lead to the class that is wanted."""
    telling = wanted == "can" or (wanted == "none" and rng.uniform() < 0.5)
    powered = cause == "thrust loss" or (cause in (NOTHING, "sensor drag") and rng.uniform() < 0.4)
    moments = cause == "battery trim" and telling
    name = "petrel-ii" if powered or moments else str(rng.choice(vehicles()))
    craft = vehicle.load(name)
    if craft.propeller is not None:  # as a mission leaves it, and as it is flown, see `flight_of`
        craft = replace(craft, correlations={("thrust_static", "thrust_slope"): -1.0})
    if rng.uniform() < (0.85 if telling else 0.5):
        craft = calibrated(craft)
    settings = int(rng.integers(2, 4)) if telling else 1
    flattest = _flattest(craft)
    pitches, forces = rng.uniform(flattest, 45.0, settings), rng.uniform(2.5, 9.0, settings)
    if telling:
        pitches[:2], forces[:2] = (flattest, 45.0), rng.permutation([2.5, 9.0])
    rpm = float(rng.uniform(700.0, 1000.0)) if powered else 0.0
    always = powered and not telling
    legs = tuple(
        Leg(
            round(float(pitches[k % settings]), 2),
            round(float(forces[(k // 2 if settings == 2 else k) % settings]), 2),
            rpm if always else 0.0,
            rpm if always or k % 2 else 0.0,
        )
        for k in range(int(rng.integers(6, 13)) if telling else int(rng.integers(3, 7)))
    )
    change = {
        NOTHING: 0.0,
        "sensor drag": DRAG * craft["parasite_drag"],
        "thrust loss": THRUST - 1.0,
        "buoyancy error": BUOYANCY,
        "pitch bias": math.radians(PITCH_DEG),
        "battery trim": BATTERY,
    }[cause]
    sign = -1.0 if cause in INJECTED[3:] and rng.uniform() < 0.5 else 1.0
    return Campaign(
        number=number,
        cause=cause,
        change=sign * change,
        craft=craft,
        legs=legs,
        depth=float(rng.uniform(120.0, 250.0)),
        water=(float(rng.uniform(0.002, 0.006 if telling else 0.012)), float(rng.uniform(100.0, 500.0))),
        ballast_std=float(rng.uniform(0.03, 0.06) if telling else rng.uniform(0.05, 0.5)),
        pitch_std_deg=float(rng.uniform(0.05, 0.15) if telling else rng.uniform(0.1, 0.5)),
    )


def calibrated(craft: Vehicle) -> Vehicle:
    """Return `craft` with the 1-sigma that an earlier mission would have left."""
    known = {
        name: replace(craft.coefficients[name], std=share * abs(craft[name]), source="calibrated")
        for name, share in CALIBRATED.items()
        if name in craft.coefficients and math.isfinite(craft[name])
    }
    if "battery_neutral_position" in craft.coefficients:
        known["battery_neutral_position"] = replace(craft.coefficients["battery_neutral_position"], std=NEUTRAL_STD)
    return replace(craft, coefficients={**craft.coefficients, **known})


def _flattest(craft: Vehicle) -> float:
    """Return the flattest pitch [deg] at which `craft` glides, with room for what its file leaves open."""
    flattest = 18.0
    while not glide_angle(craft.polar, 0.25, math.radians(flattest - 5.0))[3]:
        flattest += 0.5
    return flattest


def flight_of(planned: Campaign) -> Flight:
    """Return what is flown: the true vehicle drawn around the file, the cause injected, the orders."""
    draws = used(planned.craft, standard_normal(planned.number))
    craft = perturbed(planned.craft, draws)
    if craft.propeller is not None:
        factor = craft["thrust_static"] / planned.craft["thrust_static"]
        craft = craft.with_values({"thrust_slope": factor * planned.craft["thrust_slope"]}, "as the static thrust")
    craft = complete(craft)
    changes = {planned.cause: planned.change}
    injection = Injection(
        extra_parasite_drag=changes.get("sensor drag", 0.0),
        thrust_scale=1.0 + changes.get("thrust loss", 0.0),
        buoyancy_offset=draws["buoyancy_offset"] * planned.ballast_std + changes.get("buoyancy error", 0.0),
        # The correction of a logged pitch is the true one less the logged.
        pitch_bias_deg=draws["pitch_bias"] * planned.pitch_std_deg - math.degrees(changes.get("pitch bias", 0.0)),
        battery_offset=-changes.get("battery trim", 0.0),
    )
    return Flight(
        planned.number, 0, _plan(planned, craft), injection, planned.pitch_std_deg, planned.ballast_std, True, "", draws
    )


def _plan(planned: Campaign, craft: Vehicle) -> Plan:
    """Return the orders as a plan: a weakly stratified sea, an autopilot that holds any pitch."""
    stages: list[Stage] = []
    afloat = {"end": "duration", "value": AFLOAT_S, "afloat": True}
    for k, leg in enumerate(planned.legs):
        heading = (90.0 * k) % 360.0
        stages.append(Stage(-leg.pitch, leg.force, heading, **afloat))  # type: ignore[arg-type]
        stages.append(Stage(-leg.pitch, -leg.force, heading, "deeper", round(planned.depth, 1), rpm=leg.rpm_down))
        stages.append(Stage(leg.pitch, leg.force, heading, "duration", 60.0, rpm=leg.rpm_down and leg.rpm_up))
        stages.append(Stage(leg.pitch, leg.force, heading, "surface", rpm=leg.rpm_up))
    stages.append(Stage(-planned.legs[-1].pitch, planned.legs[-1].force, 0.0, **afloat))  # type: ignore[arg-type]
    strongest = max(leg.force for leg in planned.legs)
    return Plan(
        name=f"recovery-{planned.number}",
        description="A campaign in which one thing may be wrong.",
        vehicle=craft,
        latitude=45.0,
        longitude=-30.0,
        start=1.6e9,
        water=Water((0.0, 60.0, 150.0, 400.0), (10.5, 10.4, 9.9, 9.2), (35.0, 35.0, 35.0, 35.0)),
        nominal_depth=round(0.5 * planned.depth, 1),
        stages=tuple(stages),
        vertical_water_std=planned.water[0],
        vertical_water_time=planned.water[1],
        pump_rate=2.0 * strongest / (GRAVITY * 1025.0) / 40.0,
        battery_rate=8e-3,
        battery_range=0.3,
        pitch_slew_deg=1.5,
        pitch_deadband_deg=0.1,
        ctd_s=8.0,
        attitude_s=8.0,
        longest=200_000.0,
    )


def one(number: int, draws: int) -> dict[str, Any]:
    """Return what the pipeline finds in a campaign, and what block means drawn for its orders say."""
    try:
        planned = campaign(number)
        flown, offsets = flown_blocks(planned)
        return {
            "number": number,
            "failed": "",
            "cause": planned.cause,
            "kind": planned.kind,
            "separation": planned.separation,
            "vehicle": planned.craft.name,
            "flown": scored(planned, flown.blocks, offsets, settled(planned, flown)),
            "drawn": drawn(planned, draws),
        }
    except Exception as error:
        return {"number": number, "failed": f"campaign {number}: {type(error).__name__}: {error}"}


def flown_blocks(planned: Campaign) -> tuple[Summary, dict[str, float]]:
    """Return the campaign's blocks by the pipeline, and the true change of every unknown."""
    flight = flight_of(planned)
    flown = fly(flight)
    found = stream(InMemory(flown.records), planned.craft, flown.mission, _ignore, constants={}, methods=("kinematic",))
    true = flight.injection.into(flight.plan.vehicle)
    offsets = {name: true[name] - planned.craft[name] for name in planned.craft.coefficients}
    if planned.craft.propeller is not None:
        offsets["thrust_scale"] = true["thrust_static"] / planned.craft["thrust_static"] - 1.0
    offsets["net_buoyancy"] = flight.injection.buoyancy_offset
    offsets["pitch"] = -math.radians(flight.injection.pitch_bias_deg)
    offsets["battery_neutral_position"] = offsets.get("battery_neutral_position", 0.0) - flight.injection.battery_offset
    return found, offsets | {"water": 0.0, "turning": 0.0}


def settled(planned: Campaign, flown: Summary) -> dict[str, Any]:
    """Return the estimator's settings with the water as the blocks have it, which the report goes by."""
    return sea(flown.blocks, planned.craft, planned.given(flown.report["settings"]))


def _ignore(_estimates: pd.DataFrame) -> None:
    """Take a part's estimates: the blocks are all that is needed."""


def scored(
    planned: Campaign, blocks: pd.DataFrame, offsets: Mapping[str, float], settings: Mapping[str, Any]
) -> dict[str, Any]:
    """Return ranks, verdict and whether intervals hold the truth.

    Parameters
    ----------
    planned
        The campaign.
    blocks
        Its steady blocks.
    offsets
        True change of every unknown.
    settings
        The water that fit and ranking are told of.
    """
    given = planned.given(settings)
    ranked, fitted = rank(blocks, planned.craft, given), fit(blocks, planned.craft, given)
    tested = ranked["rows"]
    untold = {*ranked["named"], *ranked["hidden"], *ranked["hinted"]}
    untold |= {row["name"] for row in tested if abs(planned.change) < row["seen_from"]}
    untold |= {name for row in ranked["untested"] for name in row["names"]}
    inside = []
    if planned.cause in (NOTHING, "sensor drag", "buoyancy error") and not fitted["reason"]:
        inside += [_holds(x["interval_95"], offsets.get(x["name"], 0.0)) for x in fitted["parameters"]]
    of_cause = [row["parameters"][0] for row in tested if row["name"] == planned.cause != NOTHING]
    return {
        "blocks": int(blocks["used"].sum()),
        "first": tested[0]["name"] if tested else "",
        "first_by_bic": min(tested, key=lambda row: row["bic"])["name"] if tested else "",
        "first_left_out": min(tested, key=lambda row: row["left_out_rmse_m_s"])["name"] if tested else "",
        "named": ranked["named"],
        "hidden": ranked["hidden"],
        "left_open": len(ranked["named"]) != 1 and planned.cause in untold,
        "verdict": ranked["verdict"],
        "inside_fit": [bool(held) for held in inside],
        "errors_cause": [(x["value"] - offsets.get(x["name"], 0.0)) / x["std"] for x in of_cause],
        "inside_cause": [bool(abs(x["value"] - offsets.get(x["name"], 0.0)) < BOUND * x["std"]) for x in of_cause],
        "std_factors": ranked["std_factors"],
    }


def _holds(interval: Sequence[float], true: float) -> bool:
    """Return whether an interval holds the truth; an end that is NaN is open."""
    low, high = interval
    return not (true < low or true > high)


def drawn(planned: Campaign, draws: int) -> list[dict[str, Any]]:
    """Return the scores of block means drawn by theory and stated covariance, and errors in units of the bound."""
    blocks = planned_blocks(planned)
    problem = _observed(planned, blocks)
    names, known = problem.model.names, stated(problem)
    rng = np.random.default_rng([planned.number, 0xD2A3])
    unknown = next((x.unknown for x in CAUSES if x.name == planned.cause), "parasite_drag")
    column = names.index(unknown) if unknown in names else -1
    change = np.zeros(len(names))
    if column >= 0 and planned.cause != NOTHING:
        change[column] = planned.change
    out = []
    for _ in range(draws):
        x = change + _off(planned.craft, names, known, rng)
        while (problem.evaluate(x)[0] == LOST).any():  # a vehicle that cannot fly its orders
            x = change + _off(planned.craft, names, known, rng)
        seen = _seen(blocks, problem, x, rng)
        row = scored(planned, seen, dict(zip(names, x, strict=True)), planned.settings)
        if planned.kind != "cannot":
            found = posterior(_observed(planned, seen), with_cause(known, column, 1.0), free=True)
            row |= {"error": float(found.x[column] - x[column]), "std": math.sqrt(found.covariance[column, column])}
        out.append(row)
    return out


def _off(craft: Vehicle, names: Sequence[str], known: Prior, rng: np.random.Generator) -> np.ndarray:
    """Return how far unknowns are from what is stated, drawn: coefficients as those of the vehicles that are flown."""
    x: np.ndarray = known.root @ rng.standard_normal(known.root.shape[1])
    for i, name in enumerate(names):
        value, std = (craft[name], float(np.linalg.norm(known.root[i]))) if name in craft.coefficients else (0.0, 0.0)
        if value and std:
            x[i] = spread(value, std, x[i] / std) - value
    return x


def _seen(blocks: pd.DataFrame, problem: Problem, x: np.ndarray, rng: np.random.Generator) -> pd.DataFrame:
    """Return `blocks` as a vehicle with the true changes `x` flies them, with noise of the stated covariance."""
    flight = problem.model.fly(x)
    left, _slope = problem.evaluate(x)
    out, first = blocks, 0
    for term in problem.terms:
        rows = slice(first, first + term.dives.size)
        first = rows.stop
        white = rng.standard_normal(term.dives.size)
        if isinstance(term, DepthRates):
            out = out.assign(depth_rate=flight.depth_rate + _colour(term.whiten, white))
        elif isinstance(term, BatteryPositions):
            out = out.assign(battery_position=blocks["battery_position"] + term.std * (white - left[rows]))
    return out


def _colour(whiten: Whitener, white: np.ndarray) -> np.ndarray:
    """Return L `white`, of the covariance L Lᵀ that is whitened."""
    band, size = whiten.factor, white.size
    lower = np.zeros((size, size))
    for lag in range(min(band.shape[0], size)):
        lower[np.arange(lag, size), np.arange(size - lag)] = band[lag, : size - lag]
    return np.asarray(lower @ white)


def main() -> int:
    """Print what was found of what was injected, PASS or FAIL for each claim; return 1 if any fails."""
    arguments = _arguments()
    began = time.perf_counter()
    rows, failures = _all(range(arguments.first, arguments.first + arguments.campaigns), arguments.draws)
    seconds = time.perf_counter() - began
    claims = verdicts(rows)
    code = 1 if failures or not all(passed for passed, _ in claims) else 0
    if arguments.json:
        content = {"seconds": seconds, "failures": failures, "claims": claims, "campaigns": rows}
        print(json.dumps(content, indent=1))
        return code
    print(f"{len(rows)} campaigns, numbers from {arguments.first}, {arguments.draws} draws each, in {seconds:.0f} s")
    for failure in failures:
        print(f"failed: {failure}")
    _show(rows)
    for passed, text in claims:
        print(f"{'PASS' if passed else 'FAIL'} {text}")
    return code


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Is what is injected into simulated campaigns found?")
    parser.add_argument("campaigns", nargs="?", type=int, default=100, metavar="CAMPAIGNS", help="how many (100)")
    parser.add_argument("first", nargs="?", type=int, default=0, metavar="FIRST", help="number of the first (0)")
    parser.add_argument("--draws", type=int, default=5, metavar="N", help="draws of block means a campaign (5)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser.parse_args()


def _all(numbers: range, draws: int) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the scores of all campaigns in order, and what went wrong; on all cores."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    done: dict[int, dict[str, Any]] = {}
    with workers.local(os.cpu_count() or 1) as pool:
        futures = [pool.submit(one, number, draws) for number in numbers]
        for count, future in enumerate(as_completed(futures), 1):
            row = future.result()
            done[row["number"]] = row
            if sys.stderr.isatty():
                print(f"\r{count} of {len(numbers)} campaigns", end="", file=sys.stderr, flush=True)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    found = [done[number] for number in numbers]
    return [row for row in found if not row["failed"]], [row["failed"] for row in found if row["failed"]]


def verdicts(rows: list[dict[str, Any]]) -> list[tuple[bool, str]]:
    """Return whether each sentence of the claim holds, and the sentence with its figure.

    Parameters
    ----------
    rows
        As `one` returns them.
    """
    out = []
    drawn_rows = [{**row, "flown": score} for row in rows for score in row["drawn"]]
    for label, table in (("flown", rows), ("drawn", drawn_rows)):
        kinds = {kind: [row["flown"] for row in table if row["kind"] == kind] for kind in ("can", "cannot", "none")}
        causes = [row["cause"] for row in table if row["kind"] == "can"]
        held = [ok for row in table for ok in row["flown"]["inside_fit"]]
        out.append(_share(held, 0.93, 0.97, f"{label}: 95 % intervals of the fit hold the truth"))
        held = [ok for row in kinds["can"] for ok in row["inside_cause"]]
        out.append(_share(held, 0.93, 0.97, f"{label}: 95 % intervals of the injected cause hold the truth"))
        first = [score["first"] == cause for score, cause in zip(kinds["can"], causes, strict=True)]
        out.append(_share(first, 0.95, 1.0, f"{label}: the right cause first where it can be told"))
        open_left = [score["left_open"] for score in kinds["cannot"]]
        out.append(_share(open_left, 0.95, 1.0, f"{label}: said to be open where it cannot be told"))
        false = [bool(score["named"]) for score in kinds["none"]]
        out.append(_share(false, 0.0, 0.05, f"{label}: a cause named where nothing is wrong"))
    errors = np.array([row["flown"]["error"] / row["flown"]["std"] for row in drawn_rows if "error" in row["flown"]])
    ratio = float(np.sqrt(np.mean(errors**2))) if errors.size else math.nan
    error = ratio / math.sqrt(2.0 * max(errors.size, 1))
    text = f"drawn: scatter over the Cramér–Rao bound 0.9 to 1.1: {ratio:.3f} ± {error:.3f} ({errors.size})"
    out.append((0.9 <= ratio <= 1.1, text))
    return out


def _share(held: list[bool], low: float, high: float, text: str) -> tuple[bool, str]:
    """Return whether a share lies within its bounds, and the sentence."""
    if not held:
        return False, f"{text}: none"
    share = sum(held) / len(held)
    error = math.sqrt(max(share * (1.0 - share), 0.0) / len(held))
    bounds = f"{100 * low:.0f} to {100 * high:.0f} %"
    return (
        low <= share <= high,
        f"{text}, {bounds}: {100 * share:.1f} ± {100 * error:.1f} % ({sum(held)} of {len(held)})",
    )


def _show(rows: list[dict[str, Any]]) -> None:
    """Print ranks and verdicts by cause and class."""
    print(
        f"\n{'injected':16}{'orders':8}{'n':>4}{'χ² apart':>18}{'first':>7}{'by BIC':>7}{'left out':>9}{'named':>7}"
        f"{'open':>6}{'drawn: first':>14}{'named':>7}{'open':>6}"
    )
    for cause in INJECTED:
        for kind in ("none", "can", "cannot"):
            part = [row for row in rows if row["cause"] == cause and row["kind"] == kind]
            if not part:
                continue
            flown, often = [row["flown"] for row in part], [score for row in part for score in row["drawn"]]
            apart = [row["separation"] for row in part]
            line = f"{cause:16}{kind:8}{len(part):4}{min(apart):9.3g}{max(apart):9.3g}"
            for key, width in (("first", 7), ("first_by_bic", 7), ("first_left_out", 9)):
                line += f"{sum(score[key] == cause for score in flown):{width}}"
            line += (
                f"{sum(score['named'] == [cause] for score in flown):7}{sum(score['left_open'] for score in flown):6}"
            )
            if often:
                line += f"{100 * np.mean([score['first'] == cause for score in often]):12.0f} %"
                line += f"{100 * np.mean([score['named'] == [cause] for score in often]):5.0f} %"
                line += f"{100 * np.mean([score['left_open'] for score in often]):4.0f} %"
            print(line)
    print()


if __name__ == "__main__":
    raise SystemExit(main())
