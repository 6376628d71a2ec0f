"""How estimates are scored against the truth of simulated missions, and how scores of many missions are put together.

Errors within a mission are strongly correlated: its polar and pitch bias are wrong in the same way throughout. So a
mission gives one figure, all missions weigh the same, and the uncertainty of a mean is found among missions.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.fleet import Flight, Flown
from pipeline.estimate.stage import Estimated
from pipeline.records import seconds

#: What is scored.
QUANTITIES = ("speed", "angle_of_attack", "path_angle", "vertical_water_velocity")
#: Least observable samples of a class within a mission that make a figure.
LEAST_SAMPLES = 30
#: Classes of |pitch| in degrees and of the 1-sigma of w_w in cm/s.
PITCH_CLASSES, WATER_CLASSES = (15.0, 25.0, 35.0), (1.0, 2.0)
RESAMPLES = 2000


def score(flight: Flight, flown: Flown, estimated: Estimated) -> list[dict[str, Any]]:
    """Return one row for each method and class of samples of a mission.

    Parameters
    ----------
    flight, flown
        The mission, its records and truth.
    estimated
        What the estimator made of them.
    """
    rows = []
    clock = seconds(flown.truth["time"])
    for method, part in estimated.estimates.groupby("method"):
        time = seconds(part["time"])
        true = {name: np.interp(time, clock, flown.truth[name].to_numpy(dtype=np.float64)) for name in _TRUTH}
        under = true["afloat"] < 0.5
        seen = part["observable"].to_numpy(dtype=bool)
        gap = np.stack([part[name].to_numpy() - true[name] for name in QUANTITIES])
        std = np.stack([part[f"{name}_std"].to_numpy() for name in QUANTITIES])
        block = flown.records["block"].to_numpy() >= 0
        for label, chosen in _classes(true, block):
            both = seen & chosen
            if both.sum() < LEAST_SAMPLES:
                continue
            row = about(flight) | {"method": str(method), "samples": label, "n": int(both.sum())}
            row["observable"] = float(both.sum() / max((under & chosen).sum(), 1))
            row |= _figures(gap[:, both], std[:, both])
            if label == "all":
                row |= _innovations(estimated.report, str(method))
            rows.append(row)
    return rows


_TRUTH = (*QUANTITIES, "pitch", "propeller_speed", "afloat")


def about(flight: Flight) -> dict[str, Any]:
    """Return what a mission is like: one flat row."""
    plan = flight.plan
    dive, climb = plan.stages[1], plan.stages[-2]
    return {
        "seed": flight.seed,
        "again": flight.again,
        "vehicle": plan.vehicle.name,
        "power": flight.power,
        "located": flight.located,
        "water_std": plan.vertical_water_std,
        "water_time": plan.vertical_water_time,
        "pitch_noise_deg": plan.sample_noise["pitch"],
        "depth_noise": plan.sample_noise["pressure"],
        "ctd_s": plan.ctd_s,
        "attitude_s": plan.attitude_s,
        "lost": plan.lost,
        "dives": sum(stage.end == "surface" for stage in plan.stages),
        "depth": 2.0 * plan.nominal_depth,
        "dive_pitch_deg": dive.pitch_deg,
        "climb_pitch_deg": climb.pitch_deg,
        "sink": dive.net_buoyancy,
        "rise": climb.net_buoyancy,
        "pitch_bias_std_deg": flight.pitch_std_deg,
        "ballast_std": flight.ballast_std,
        **{f"z_{name}": value for name, value in flight.draws.items()},
    }


def _classes(true: dict[str, np.ndarray], block: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Return the classes of samples, from the truth, and where each holds; shape (m,)."""
    under = true["afloat"] < 0.5
    pitch = np.abs(np.degrees(true["pitch"]))
    powered = true["propeller_speed"] > 0.5
    yield "all", under
    yield "unpowered", under & ~powered
    yield "powered", under & powered
    yield "down", under & (true["path_angle"] < 0.0)
    yield "up", under & (true["path_angle"] >= 0.0)
    yield "steady block", under & block
    yield "outside blocks", under & ~block
    bounds = (0.0, *PITCH_CLASSES, 90.0)
    for low, high in pairwise(bounds):
        yield f"|pitch| {low:g}-{high:g}", under & (pitch >= low) & (pitch < high)


def _figures(gap: np.ndarray, std: np.ndarray) -> dict[str, float]:
    """Return coverage of the 95 % interval, mean z², bias, RMS error and RMS 1-sigma of errors of shape (4, n)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        z = gap / std
    figures: dict[str, float] = {}
    for k, name in enumerate(QUANTITIES):
        figures |= {
            f"cover_{name}": float(np.mean(np.abs(z[k]) < 1.96)),
            f"nees_{name}": float(np.mean(z[k] ** 2)),
            f"bias_{name}": float(np.mean(gap[k])),
            f"rms_{name}": float(np.sqrt(np.mean(gap[k] ** 2))),
            f"std_{name}": float(np.sqrt(np.mean(std[k] ** 2))),
        }
    return figures


def _innovations(report: dict[str, Any], method: str) -> dict[str, float]:
    """Return mean normalised innovation squared of each instrument, and whether it is in its own χ² band."""
    entries = report["consistency"].get(method, {}).get("innovations", [])
    found = {entry["instrument"]: entry for entry in entries if entry["nis"] is not None}
    figures = {f"nis_{name}": float(entry["nis"]) for name, entry in found.items()}
    for name, entry in found.items():
        figures[f"std_nis_{name}"] = (float(entry["high_effective"]) - float(entry["low_effective"])) / (2.0 * 1.96)
    return figures | {
        f"in_band_{name}": float(entry["low_effective"] <= entry["nis"] <= entry["high_effective"])
        for name, entry in found.items()
    }


def splits(table: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Return the classes of samples and of missions, and the rows of each; one row a mission.

    Parameters
    ----------
    table
        Rows of `score`, one method.
    """
    whole = table[table["samples"] == "all"]
    for label in table["samples"].unique():
        yield str(label), table[table["samples"] == label]
    for name, rows in whole.groupby("vehicle"):
        yield str(name), rows
    for name, rows in whole.groupby("power"):
        yield f"power: {name}", rows
    bounds = (0.0, *WATER_CLASSES, 3.0)
    for low, high in pairwise(bounds):
        yield f"w_w {low:g}-{high:g} cm/s", whole[(whole["water_std"] * 100.0).between(low, high)]
    yield "with fixes", whole[whole["located"]]
    yield "without fixes", whole[~whole["located"]]


def mean_over_missions(values: pd.Series) -> tuple[float, float]:
    """Return the mean of one figure a mission and its 1-sigma; NaN with fewer than two."""
    known = values.dropna().to_numpy()
    if known.size < 2:
        return float(known.mean()) if known.size else np.nan, np.nan
    return float(known.mean()), float(known.std(ddof=1) / np.sqrt(known.size))


def band(values: pd.Series) -> tuple[float, float]:
    """Return the 95 % band of the mean of one figure a mission, by drawing missions again with replacement."""
    known = values.dropna().to_numpy()
    if known.size < 2:
        return np.nan, np.nan
    drawn = np.random.default_rng(0).integers(known.size, size=(RESAMPLES, known.size))
    low, high = np.percentile(known[drawn].mean(axis=1), (2.5, 97.5))
    return float(low), float(high)


def verdicts(table: pd.DataFrame) -> list[tuple[bool, str]]:
    """Return whether each sentence of the claim holds for one method, and the sentence with its figure.

    The claim: 95 % intervals of V, α, γ and w_w each cover 93 to 97 % of the truth; mean z² of each is 1 within its
    95 % band over missions; and the mean normalised innovation squared of each instrument is in the 95 % χ² band that
    goes with the missions' own.

    Parameters
    ----------
    table
        Rows of `score`, one method.
    """
    whole = table[table["samples"] == "all"]
    out = []
    for name in QUANTITIES:
        cover, error = mean_over_missions(whole[f"cover_{name}"])
        text = f"95 % intervals of {name} cover 93 to 97 %: {100 * cover:.1f} ± {100 * error:.1f} %"
        out.append((0.93 <= cover <= 0.97, text))
    for name in QUANTITIES:
        low, high = band(whole[f"nees_{name}"])
        mean = whole[f"nees_{name}"].mean()
        out.append((low <= 1.0 <= high, f"NEES of {name} is 1 in its 95 % band: {mean:.2f}, {low:.2f} to {high:.2f}"))
    measured = whole.dropna(axis="columns", how="all").columns.astype(str)
    for column in measured[measured.str.startswith("nis_")]:
        name = column.removeprefix("nis_")
        known = whole[f"std_nis_{name}"].dropna()
        half = 1.96 * float(np.sqrt(np.sum(known**2))) / known.size
        low, high = 1.0 - half, 1.0 + half
        inside = 100.0 * whole[f"in_band_{name}"].mean()
        mean = whole[column].mean()
        text = f"NIS of {name} is in its 95 % χ² band: {mean:.3f}, {low:.3f} to {high:.3f}"
        out.append((low <= mean <= high, f"{text} ({inside:.0f} % of missions in their own)"))
    return out
