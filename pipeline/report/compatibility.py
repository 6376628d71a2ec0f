"""Do the instruments agree? What was found before anything was estimated, in the units and words of people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pipeline.report.rounding import amount, counted, signed

#: Quantities in the order of the page: what each is, factor from the unit reported, unit shown, digits.
QUANTITIES: dict[str, tuple[str, float, str, int]] = {
    "clock_offset": ("offset between the clocks of pressure and pitch", 1.0, "s", 1),
    "pressure_offset": ("pressure read at the surface", 1.0, "dbar", 2),
    "pressure_lag": ("lag of the pressure sensor", 1.0, "s", 1),
    "pitch_bias": ("bias of pitch", 180.0 / math.pi, "°", 2),
    "pitch_scale": ("scale of pitch, true over logged", 1.0, "", 3),
    "speed_scale": ("scale error of the speed sensor", 100.0, "%", 2),
}
#: Factor from SI to the unit in which an instrument's outliers are shown, and the unit.
INSTRUMENTS = {"depth": (1.0, "m"), "pitch": (180.0 / math.pi, "°"), "speed": (100.0, "cm/s")}


def compatibility(estimate: Mapping[str, Any], *, sensor_used: bool) -> dict[str, Any]:
    """Return what the look at the instruments found.

    Parameters
    ----------
    estimate
        The report of stage 2; its ``compatibility`` is used, which may be missing or empty, and with it the scale of
        a speed sensor that was used, by the kinematic method.
    sensor_used
        Whether the speed sensor was looked at.

    Returns
    -------
    dict
        ``sentence``, ``applied``, ``quantities`` (a row each, with ``verdict`` and ``reason``), ``outliers`` (a row an
        instrument) and ``undetermined`` (reason, and the quantities that it keeps unknown).
    """
    found = dict(estimate.get("compatibility") or {})
    if scale := (estimate.get("speed_scale") or {}).get("kinematic"):
        found["speed_scale"] = scale
    rows = [_quantity(name, found[name]) for name in QUANTITIES if name in found]
    outliers = [row for row in _outliers(found.get("outliers") or {}) if sensor_used or row["instrument"] != "speed"]
    applied = [row["quantity"] for row in rows if row["applied"]]
    applied += [f"{row['count']} outliers of {row['instrument']} left out" for row in outliers if row["count"]]
    undetermined: dict[str, list[str]] = {}
    for row in rows:
        if row["verdict"] == "not determined":
            undetermined.setdefault(row["reason"], []).append(row["quantity"])
    result = {
        "applied": applied,
        "quantities": rows,
        "outliers": outliers,
        "undetermined": [{"reason": reason, "quantities": names} for reason, names in undetermined.items()],
    }
    return {"sentence": _sentence(result), **result}


def _quantity(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return one row of the table, in the unit shown."""
    meaning, factor, unit, digits = QUANTITIES[name]
    value, std = (math.nan if entry.get(key) is None else factor * float(entry[key]) for key in ("value", "std"))
    if not math.isfinite(value) or not entry.get("determined", True):
        verdict = "not determined"
    elif not entry["significant"]:
        verdict = "not significant"
    else:
        verdict = "applied" if entry["applied"] else "significant, not applied"
    return {
        "name": name,
        "quantity": meaning,
        "value": value,
        "std": std,
        "unit": unit,
        "digits": digits,
        "significant": bool(entry["significant"]),
        "applied": bool(entry["applied"]),
        "verdict": verdict,
        "reason": "; ".join(
            filter(None, (str(entry.get("reason") or ""), _parts(entry.get("parts"), factor, unit, digits)))
        ),
    }


def _parts(parts: Mapping[str, Any] | None, factor: float, unit: str, digits: int) -> str:
    """Return what the parts of a mission that was estimated in parts say of a quantity; "" of one in one part."""
    if parts is None:
        return ""
    if parts["known"] == 1:
        return f"told by one of {parts['of']} parts"
    low, high = (signed(factor * parts[end], digits) for end in ("lowest", "highest"))
    size = unit if unit == "°" else f" {unit}".rstrip()
    words = f"mean of {parts['known']} of {parts['of']} parts, each by itself, from {low} to {high}{size}"
    if parts["agree"]:
        return f"{words}, no farther apart than their 1σ say"
    freedom = parts["known"] - 1
    return f"{words}: farther apart than their 1σ say (χ² {parts['chi_square']:.1f} for {freedom}), so this is wider"


def _outliers(entry: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return one row an instrument: how many outliers, and the first of them with the second at which they are."""
    rows = []
    for name, item in (entry.get("instruments") or {}).items():
        factor, unit = INSTRUMENTS[name]
        first = [{"at_s": float(one["time_s"]), "value": factor * float(one["value"])} for one in item["first"]]
        rows.append({"instrument": name, "count": int(item["count"]), "unit": unit, "first": first})
    return rows


def _sentence(found: Mapping[str, Any]) -> str:
    """Return the whole in one plain sentence."""
    rows, outliers = found["quantities"], [row for row in found["outliers"] if row["count"]]
    if not rows:
        return "Whether the instruments agree was not looked at: there are no records."
    words = [_words(row) for row in rows if row["significant"]]
    words += [f"{counted(row['count'], 'outlier')} of {row['instrument']}" for row in outliers]
    unknown = sum(row["verdict"] == "not determined" for row in rows)
    if not words:
        beyond = f"; {unknown} of {len(rows)} quantities could not be determined" if unknown else ""
        return f"As far as can be seen they agree: no difference is significant, and nothing was applied{beyond}."
    applied = [row["quantity"] for row in rows if row["applied"]]
    if outliers:
        applied.append("outliers, by leaving them out")
    done = f"Applied: {', '.join(applied)}" if applied else "Nothing was applied"
    waits = [row["quantity"] for row in rows if row["significant"] and not row["applied"]]
    done += f"; not applied: {', '.join(waits)}" if applied and waits else ""
    return f"Not in everything: {'; '.join(words)}. {done}."


def _words(row: Mapping[str, Any]) -> str:
    """Return one significant quantity in words."""
    size = amount(abs(row["value"]), row["std"], sign=False)
    size = f"{size}{row['unit'] if row['unit'] == '°' else ' ' + row['unit']}".rstrip()
    if row["name"] == "clock_offset":
        return f"depth bends {size} {'before' if row['value'] > 0.0 else 'after'} the pitch does"
    if row["name"] == "pressure_offset":
        return f"pressure at the surface is {size} too {'great' if row['value'] > 0.0 else 'small'}"
    if row["name"] == "speed_scale":
        return f"the speed sensor reads {size} too {'much' if row['value'] > 0.0 else 'little'}"
    if row["name"] == "pitch_scale":
        return f"pitch is {size} times what is logged"
    return f"pitch is {size} too {'low' if row['value'] > 0.0 else 'high'}"
