"""The force estimate on the page: what of the theory was adjusted to the depth rate, and what the data leave open."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.report.rounding import amount

#: Parameters of the force model in the order of the page: what each is, factor from the unit reported, unit shown.
PARAMETERS: dict[str, tuple[str, float, str]] = {
    "parasite_drag": ("parasite drag", 100.0, "%"),
    "net_buoyancy": ("net buoyancy", 1.0, "N"),
    "thrust": ("thrust", 100.0, "%"),
    "compressibility": ("compressibility of the hull", 1e10, "10⁻¹⁰/Pa"),
    "thermal_expansion": ("thermal expansion of the hull", 1e6, "10⁻⁶/K"),
    "hull_time": ("time in which the hull takes on the water's temperature", 1.0, "s"),
    "carried_water": ("water that the fairing carries along, of the hull's volume", 100.0, "%"),
    "flushing_time": ("time in which that water is renewed", 1.0, "s"),
    "lift_slope": ("lift slope", 100.0, "%"),
    "induced_drag": ("induced drag", 100.0, "%"),
    "lift_at_zero": ("lift at zero angle of attack", 1.0, "kg/m"),
    "pitch": ("bias of pitch", 180.0 / math.pi, "°"),
}
#: What a verdict begins with.
DETERMINED, UNDETERMINED, CONSIDERED, CONTRADICTED = "determined", "not determined", "considered", "contradicts"
#: What depth rate alone never tells apart, and is not adjusted.
NEVER = ("pitch", "lift_slope", "induced_drag", "lift_at_zero")
#: Which experiment tells parameters that the data left open.
EXPERIMENTS = (
    (NEVER, "a speed sensor that may be used (speed_sensor: use), on dives and climbs at several pitches"),
    (("parasite_drag",), "long steady glides at several pumped volumes and pitches"),
    (("net_buoyancy",), "dives and climbs with equal pumped volumes in the same water, or a weighing in the water"),
    (("thrust",), "the propeller on and off, and at several speeds, with the pitch held"),
    (("compressibility",), "dives deeper than {depth}"),
    (("thermal_expansion", "hull_time"), "dives through a sharper thermocline, with a stay below it"),
    (("carried_water", "flushing_time"), "dives through a sharper pycnocline, with a stay below it"),
)
#: Why nothing in a mission depends on a parameter.
UNTOUCHED = {"thrust": "the propeller did not turn", "flushing_time": "none was found to be carried"}
#: Noise levels: what each is, by which methods it is used, shown as factor · value ** power, unit shown.
NOISE: dict[str, tuple[str, tuple[str, ...], float, float, str]] = {
    "sigma_w": ("vertical velocity of the water", ("kinematic", "force"), 100.0, 1.0, "cm/s"),
    "tau_w": ("its correlation time", ("kinematic", "force"), 1.0, 1.0, "s"),
    "depth_noise": ("depth, each sample", ("kinematic", "force"), 100.0, 1.0, "cm"),
    "pitch_noise": ("pitch, each sample", ("kinematic", "force"), 180.0 / math.pi, 1.0, "°"),
    "swell": ("swell, a random walk of depth", ("kinematic", "force"), 1000.0, 0.5, "mm per √s"),
    "force_drift": ("what the theory leaves of the speed, a random walk", ("force",), 1000.0, 0.5, "mm/s per √s"),
    "load": ("slow error of net buoyancy", ("force",), 1.0, 1.0, "N"),
}


def adjustment(estimate: Mapping[str, Any], *, sensor_used: bool, depth: float) -> dict[str, Any]:
    """Return the force estimate's parameters and noise levels in the units of people.

    Parameters
    ----------
    estimate
        The report of stage 2; its ``force`` is used, which may be missing.
    sensor_used
        Whether the parameters were adjusted to a speed sensor, too.
    depth
        Greatest depth of the mission, m.

    Returns
    -------
    dict
        ``reason`` why there is no force estimate, empty where there is one; ``sentences``, ``parameters``, ``noise``,
        ``converged``, ``observable_percent`` and ``reasons``.
    """
    found: Mapping[str, Any] = estimate.get("force") or {"reason": "the estimates came without one"}
    if "parameters" not in found:
        nothing: dict[str, Any] = {"sentences": [], "parameters": [], "noise": [], "reasons": []}
        return {"reason": str(found["reason"]), **nothing, "converged": None, "observable_percent": math.nan}
    rows = [_parameter(name, found["parameters"][name]) for name in PARAMETERS if name in found["parameters"]]
    total = sum(found["reasons"].values()) / max(1.0 - found["observable_share"], 1e-12)
    return {
        "reason": "",
        "sentences": [
            *_sentences(rows, bool(found["converged"]), sensor_used=sensor_used, depth=depth),
            *_untouched(found["untouched"]),
        ],
        "parameters": rows,
        "noise": _noise(estimate.get("settings") or {}, found["settings"]),
        "converged": bool(found["converged"]),
        "observable_percent": 100.0 * float(found["observable_share"]),
        "reasons": [
            {"reason": reason, "samples": int(count), "percent": 100.0 * count / total}
            for reason, count in sorted(found["reasons"].items(), key=lambda item: -item[1])
        ],
    }


def _parameter(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return one row of the table, in the unit shown."""
    meaning, factor, unit = PARAMETERS[name]
    scaled = {key: factor * float(entry[key]) for key in ("before", "std_before", "value", "std")}
    return {"name": name, "parameter": meaning, **scaled, "unit": unit, "verdict": str(entry["verdict"])}


def _noise(kinematic: Mapping[str, Any], force: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the noise levels of both methods, one row each."""

    def shown(settings: Mapping[str, Any], method: str, name: str) -> float:
        _, methods, factor, power, _ = NOISE[name]
        known = method in methods and settings.get(name) is not None
        return factor * float(settings[name]) ** power if known else math.nan

    return [
        {
            "name": name,
            "noise": meaning,
            "kinematic": shown(kinematic, "kinematic", name),
            "force": shown(force, "force", name),
            "unit": unit,
        }
        for name, (meaning, _, _, _, unit) in NOISE.items()
    ]


def _sentences(rows: list[dict[str, Any]], converged: bool, *, sensor_used: bool, depth: float) -> list[str]:
    """Return what the adjustment says in plain sentences, and which experiment would tell the rest."""
    told = [row for row in rows if row["verdict"].startswith((DETERMINED, CONTRADICTED))]
    words = [f"{row['parameter']} {_shown(row)}" for row in told]
    source = "the depth rate and the speed sensor" if sensor_used else "the depth rate alone"
    out = [f"Adjusted to {source}: {'; '.join(words)}."] if words else []
    if not words:
        out.append(f"In this mission {source} determines nothing better than it was known before.")
    against = [row["parameter"] for row in rows if row["verdict"].startswith(CONTRADICTED)]
    if against:
        out.append(
            f"Against what was known before stand{'s' if len(against) == 1 else ''} {_listed(against)}: the vehicle "
            "file, the ballast or the shape of the theory is wrong there."
        )
    if not converged:
        out.append("The adjustment was still moving at its last step: take the values with care.")
    left = {row["name"]: row["parameter"] for row in rows if row["verdict"].startswith((UNDETERMINED, CONSIDERED))}
    reached = f"the {depth:.0f} m of this mission" if math.isfinite(depth) else "these"
    for names, experiment in EXPERIMENTS:
        waiting = [left[name] for name in names if name in left]
        if waiting and sensor_used and names[0] in NEVER:
            out.append(f"Taken as known before, with what that leaves open: {_listed(waiting)}.")
        elif waiting:
            out.append(f"Not determined: {_listed(waiting)}. It would take {experiment.format(depth=reached)}.")
    return out


def _untouched(names: Sequence[str]) -> list[str]:
    """Return a sentence on the parameters that no measurement depends on, if there are some."""
    meaning = {name: PARAMETERS[name][0].partition(",")[0] for name in names}
    words = [f"{meaning[name]}{f' ({UNTOUCHED[name]})' if name in UNTOUCHED else ''}" for name in names]
    return [f"Nothing that was logged depends on {_listed(words)}."] if words else []


def _shown(row: Mapping[str, Any]) -> str:
    """Return a parameter's value ± 1-sigma with its unit; changes have a sign."""
    return f"{amount(row['value'], row['std'], sign=row['before'] == 0.0)} {row['unit']}"


def _listed(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
