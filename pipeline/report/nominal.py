"""The table of the paper's Section 5 for any mission: settings, published, theory, measured, stable range.

Every part of a mission has its own row: those that mission.yaml names under ``nominal``, or else dives, climbs and
level flight as flown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import pandas as pd

from pipeline.mission import Mission, Nominal
from pipeline.model.case import driven
from pipeline.model.predict import nominal
from pipeline.report.averages import combine
from pipeline.report.compare import DIRECTIONS, floats
from pipeline.vehicle import Vehicle

WORDS: dict[int, Literal["down", "level", "up"]] = {-1: "down", 0: "level", 1: "up"}
SIDES = {word: side for side, word in WORDS.items()}
#: Path angle beyond which flight that is meant to be level is not, degrees.
LEVEL_DEG = 1.0
#: 1-sigma of a logged propeller speed, relative, where a setting is all that is known.
PROPELLER_STD = 0.005


def parts(mission: Mission, vehicle: Vehicle, blocks: pd.DataFrame) -> list[Nominal]:
    """Return the parts of a mission: as in mission.yaml, or else one per direction and powered or not, as flown."""
    if mission.nominal:
        return list(mission.nominal)
    used = blocks[blocks["used"].to_numpy(dtype=bool)]
    out = []
    for _key, group in used.groupby(["direction", "powered"], sort=True):
        side, powered = int(group["direction"].iloc[0]), bool(group["powered"].iloc[0])
        columns = {name: floats(group, name) for name in ("net_buoyancy", "pitch", "density")}
        columns["propeller_speed"], columns["propeller_power"] = driven(
            vehicle, np.full(len(group), powered), floats(group, "propeller_speed"), floats(group, "propeller_power")
        )
        values = {
            name: float(np.nanmedian(column)) if np.isfinite(column).any() else math.nan
            for name, column in columns.items()
        }
        if not math.isfinite(values["net_buoyancy"]) or not math.isfinite(values["pitch"]):
            continue
        out.append(
            Nominal.model_construct(
                name=DIRECTIONS[side] + (" under propeller" if powered else ""),
                net_buoyancy=values["net_buoyancy"],
                propeller_speed_rpm=60.0 * values["propeller_speed"],
                propeller_power=values["propeller_power"],
                pitch_deg=math.degrees(values["pitch"]),
                density=values["density"] if math.isfinite(values["density"]) else None,
                direction=WORDS[side],
                powered=powered,
                source="medians of the steady blocks",
            )
        )
    return out


def table(
    mission: Mission,
    vehicle: Vehicle,
    blocks: pd.DataFrame,
    comparison: pd.DataFrame,
    estimate: Mapping[str, Any],
) -> list[dict[str, Any]]:
    """Return one row per part of the mission, speeds in m/s and angles in degrees.

    Parameters
    ----------
    mission, vehicle
        As resolved.
    blocks
        The canonical table `records.BLOCKS`.
    comparison
        The result of `compare.compare`.
    estimate
        The estimator's report (``gps``, ``settings``).
    """
    rows = []
    for part in parts(mission, vehicle, blocks):
        pitch = math.nan if part.pitch_deg is None else math.radians(part.pitch_deg)
        theory = nominal(
            vehicle,
            net_buoyancy=part.net_buoyancy,
            propeller_speed=part.propeller_speed_rpm / 60.0,
            pitch=None if math.isnan(pitch) else pitch,
            density=part.density,
            propeller_power=part.propeller_power,
            net_buoyancy_std=ballast_std(mission, estimate),
            propeller_speed_std=PROPELLER_STD * part.propeller_speed_rpm / 60.0,
            pitch_std=math.radians(mission.pitch.std_deg),
        )
        row = {
            "name": part.name,
            "source": part.source,
            "as_set": bool(mission.nominal),
            "net_buoyancy_N": part.net_buoyancy,
            "powered": _powered(part),
            "propeller_speed_rpm": part.propeller_speed_rpm,
            "propeller_power_W": part.propeller_power,
            "pitch_deg": math.degrees(pitch),
            "published_speed_m_s": part.published_speed,
            "published_theory_speed_m_s": part.published_theory_speed,
            "published_theory_pitch_deg": part.published_theory_pitch_deg,
            **_flight("free", theory["free_pitch"]),
            **_flight("held", theory["held_pitch"]),
            "held_moment_N_m": theory["held_pitch"]["required_moment"],
            "stable_speed_lower_m_s": theory["range"]["speed_lower"],
            "stable_speed_upper_m_s": theory["range"]["speed_upper"],
            "stable_reason": theory["range"]["reason"],
            "stable_speed_lower_as_printed_m_s": theory["range_paper"]["speed_lower"],
            "stable_speed_upper_as_printed_m_s": theory["range_paper"]["speed_upper"],
            **measured(part, blocks, comparison, estimate),
        }
        row |= error(row, comparison, estimate.get("settings"))
        if not row["as_set"] and math.isfinite(row["as_flown_speed_m_s"]):
            row["held_speed_m_s"] = row["as_flown_speed_m_s"]
            row["held_speed_std_m_s"] = row["as_flown_speed_std_m_s"]
        row["stable_holds_measured"] = _inside(row)
        row["notes"] = notes(part, row)
        rows.append(row)
    return rows


def _powered(part: Nominal) -> bool:
    return part.propeller_speed_rpm > 0.0 or part.propeller_power > 0.0 if part.powered is None else part.powered


def _flight(prefix: str, theory: Mapping[str, Any]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name in ("speed", "pitch", "path_angle", "angle_of_attack"):
        factor, unit = (1.0, "m_s") if name == "speed" else (180.0 / math.pi, "deg")
        out[f"{prefix}_{name}_{unit}"] = factor * theory[name]
        out[f"{prefix}_{name}_std_{unit}"] = factor * theory[f"{name}_std"]
    out[f"{prefix}_reason"] = theory["reason"]
    return out


def measured(
    part: Nominal, blocks: pd.DataFrame, comparison: pd.DataFrame, estimate: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the speed and pitch measured in this part, from where, or why not."""
    powered = _powered(part)
    kind = blocks["powered"].to_numpy(dtype=bool) == powered
    if part.direction is not None:
        kind &= blocks["direction"].to_numpy() == SIDES[part.direction]
    flown = blocks[kind]
    own = flown[flown["used"].to_numpy(dtype=bool)]
    pitches = floats(own, "pitch")
    out: dict[str, Any] = {
        "blocks": len(own),
        "blocks_without_theory": 0,
        "measured_blocks": [],
        "measured_pitch_deg": math.degrees(float(np.nanmean(pitches))) if np.isfinite(pitches).any() else math.nan,
        "measured_speed_m_s": math.nan,
        "measured_speed_std_m_s": math.nan,
        "measured_from": "",
        "measured_reason": "",
        **_sensor(own, comparison),
    }
    legs = gps_speed(estimate)
    level = bool(((blocks["direction"] == 0) & blocks["powered"]).any())
    if powered and level and part.direction in (None, "level") and legs is not None:
        count = len(estimate["gps"].get("legs", []))
        return out | {
            "measured_speed_m_s": legs[0],
            "measured_speed_std_m_s": legs[1],
            "measured_blocks": [-1],
            "measured_from": f"GPS fixes at the ends of {count} submerged legs, current cancelled",
        }
    rows = comparison[
        (comparison["quantity"] == "speed") & (comparison["trim"] == "pitch") & comparison["block"].isin(own["block"])
    ]
    if len(rows):
        weights = 1.0 / np.maximum(floats(rows, "u_val"), 1e-9) ** 2
        mean = combine(rows, weights / weights.sum(), estimate.get("settings"))
        return out | {
            "measured_speed_m_s": mean["measured"],
            "measured_speed_std_m_s": mean["measured_std"],
            "measured_blocks": rows["block"].tolist(),
            "blocks_without_theory": int(np.isfinite(floats(own, "speed")).sum()) - len(rows),
            "measured_from": f"kinematic estimate, {len(rows)} steady blocks by 1/u_val²",
        }
    return out | {"measured_reason": _why_not(flown, own)}


def error(
    row: Mapping[str, Any], comparison: pd.DataFrame, settings: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return theory with the pitch held, as flown in the blocks behind the measured speed, with E and u_val."""
    quantity = "gps_speed" if row["measured_blocks"] == [-1] else "speed"
    rows = comparison[
        (comparison["trim"] == "pitch")
        & (comparison["quantity"] == quantity)
        & comparison["block"].isin(row["measured_blocks"])
    ]
    if rows.empty:
        missing = ("as_flown_speed_m_s", "as_flown_speed_std_m_s", "error_m_s", "u_val_m_s", "significance")
        none = dict.fromkeys(missing, math.nan)
        return none | {"label": ""}
    weights = 1.0 / np.maximum(floats(rows, "u_val"), 1e-9) ** 2
    mean = combine(rows, weights / weights.sum(), settings)
    return {
        "as_flown_speed_m_s": mean["predicted"],
        "as_flown_speed_std_m_s": mean["predicted_std"],
        "error_m_s": mean["error"],
        "u_val_m_s": mean["u_val"],
        "significance": mean["significance"],
        "label": str(rows["label"].iloc[0]),
    }


def _sensor(own: pd.DataFrame, comparison: pd.DataFrame) -> dict[str, float]:
    """Return the mean speed by the sensor in these blocks."""
    rows = comparison[
        (comparison["quantity"] == "sensor_speed")
        & (comparison["trim"] == "pitch")
        & comparison["block"].isin(own["block"])
    ]
    if rows.empty:
        return {"sensor_speed_m_s": math.nan, "sensor_speed_std_m_s": math.nan}
    weights = 1.0 / np.maximum(floats(rows, "u_measured"), 1e-9) ** 2
    mean = combine(rows, weights / weights.sum())
    return {"sensor_speed_m_s": mean["measured"], "sensor_speed_std_m_s": mean["measured_std"]}


def _why_not(flown: pd.DataFrame, own: pd.DataFrame) -> str:
    """Return why there is no measured speed in the blocks `flown` in this part, of which `own` are used."""
    if flown.empty:
        return "unobservable: no steady block of this kind"
    if own.empty:
        reasons = flown["reason"].astype(str).value_counts(sort=False).sort_index()
        reason = str(reasons.idxmax()).removeprefix("speed unobservable: ")
        return f"unobservable: {reason}" if reason else "unobservable: no reason given"
    if not np.isfinite(floats(own, "speed")).any():
        return "unobservable: depth carries no speed here, and neither GPS legs nor a speed sensor say otherwise"
    return "no theory to compare with"


def ballast_std(mission: Mission, estimate: Mapping[str, Any]) -> float:
    """Return the 1-sigma, N, that stage 2 gave the constant part of net buoyancy; that of mission.yaml without one."""
    return float((estimate.get("ballast") or {}).get("std", mission.ballast.std))


def gps_speed(estimate: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the speed of level powered flight by GPS legs and its 1-sigma, m/s, or None."""
    legs = estimate.get("gps")
    if not isinstance(legs, Mapping):
        return None
    pair = legs.get("speed"), legs.get("speed_std")
    if all(isinstance(number, int | float) and math.isfinite(number) for number in pair):
        return float(pair[0]), float(pair[1])  # type: ignore[arg-type]
    return None


def notes(part: Nominal, row: Mapping[str, Any]) -> list[str]:
    """Return what a reader of the row must know."""
    out = []
    climb = row["held_path_angle_deg"]
    level = part.direction == "level" or (part.direction is None and abs(row["pitch_deg"]) < 10.0)
    if level and math.isfinite(climb) and abs(climb) > LEVEL_DEG:
        out.append(
            f"At a pitch of {row['pitch_deg']:.1f}° and a net buoyancy of {part.net_buoyancy:+.1f} N theory "
            f"{'climbs' if climb > 0 else 'sinks'} at {climb:.1f}°: this is not exact depth keeping."
        )
    if row["free_reason"]:
        out.append(f"No theory with the pitch left free: {row['free_reason']}.")
    if row["held_reason"]:
        out.append(f"No theory with the pitch held: {row['held_reason']}.")
    return out


def _inside(row: Mapping[str, Any]) -> bool | None:
    """Return whether the measured speed lies in the stable range; None where either is unknown."""
    low, high, speed = (row[key] for key in ("stable_speed_lower_m_s", "stable_speed_upper_m_s", "measured_speed_m_s"))
    if not all(math.isfinite(number) for number in (low, high, speed)):
        return None
    return bool(low < speed < high)
