"""The vehicle as a mission has corrected it, in the form of a vehicle file that another mission may name.

The coefficients are those that the force model was adjusted to (the ``force`` of estimate.json, by the filter-error
method); only what the data determine is changed, and the rest stays as it was and says so. Net buoyancy and the time in
which the hull takes on the temperature of the water belong to the mission, not to the vehicle; they go into comments.
So does the water that its fairing carries along: in a thermocline a hull that lags behind looks alike.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pipeline.findings import InputError
from pipeline.model.forces import GRAVITY
from pipeline.report.adjustment import CONSIDERED, CONTRADICTED
from pipeline.report.adjustment import DETERMINED as DETERMINED_WORD
from pipeline.report.rounding import amount
from pipeline.vehicle import KNOWN, Coefficient, Vehicle, check_value

if TYPE_CHECKING:
    from pipeline.mission import Mission
    from pipeline.report import Inputs

FILE = "vehicle.yaml"
#: Coefficients that each parameter of the force model changes: by a share of the value, or by an amount in its unit.
SHARES: dict[str, tuple[str, ...]] = {"parasite_drag": ("parasite_drag",), "thrust": ("thrust_static", "thrust_slope")}
AMOUNTS = ("compressibility", "thermal_expansion")
#: A value that contradicts what was known before is taken if its 1-sigma fell below this share of what it was.
DETERMINED = 0.5
#: Digits kept of a value or 1-sigma that was changed, and decimals of a correlation.
DIGITS, DECIMALS = 7, 4


@dataclass(frozen=True)
class Change:
    """What became of one coefficient: value and 1-sigma before and now, whether they differ, and why (not)."""

    name: str
    before: float
    std_before: float
    value: float
    std: float
    changed: bool
    why: str


@dataclass(frozen=True)
class Corrected:
    """A vehicle with what a mission says of its coefficients.

    Attributes
    ----------
    vehicle
        With the corrected values, their 1-sigma and correlations.
    changes
        One for each coefficient that the depth rate may adjust.
    ballast
        The line for mission.yaml with the net buoyancy found; empty where it was not determined.
    remarks
        What else was found, and why nothing was corrected if so.
    """

    vehicle: Vehicle
    changes: tuple[Change, ...]
    ballast: str
    remarks: tuple[str, ...]


def correct(
    vehicle: Vehicle, mission: Mission, estimate: Mapping[str, Any], *, neutral_density: float = math.nan
) -> Corrected:
    """Return `vehicle` as corrected by a mission.

    Parameters
    ----------
    vehicle
        As resolved for the mission.
    mission
        The mission; its name is the source of what is changed.
    estimate
        The report of stage 2; its ``force`` is used, which may be missing.
    neutral_density
        Density in which the vehicle was taken to hang with the engine at zero, kg/m³; NaN if it is not known.
    """
    force = estimate.get("force") or {}
    found: Mapping[str, Any] = force.get("parameters") or {}
    if not found:
        return Corrected(vehicle, (), "", (f"Nothing is corrected: {force.get('reason') or 'no force estimate'}.",))
    if not force.get("converged"):
        return Corrected(vehicle, (), "", ("Nothing is corrected: the adjustment did not converge.",))
    changes = [
        _change(vehicle, name, found[parameter], relative=parameter in SHARES)
        for parameter, names in (SHARES | {name: (name,) for name in AMOUNTS}).items()
        if parameter in found
        for name in names
    ]
    return Corrected(
        _changed(vehicle, mission.slug, changes, force.get("correlation") or {}),
        tuple(changes),
        _ballast(mission, vehicle, found.get("net_buoyancy"), neutral_density),
        tuple(_remarks(found)),
    )


def made_by(mission: str) -> str:
    """Return how the source of a coefficient begins that the mission of this name has corrected."""
    return f"mission {mission},"


def of_mission(inputs: Inputs) -> Corrected:
    """Return the vehicle of a mission as the mission has corrected it."""
    ballast = inputs.estimate.get("ballast")
    neutral = float(ballast["mass"]) / float(ballast["volume"]) if ballast else math.nan
    return correct(inputs.vehicle, inputs.mission, inputs.estimate, neutral_density=neutral)


def _is_determined(entry: Mapping[str, Any]) -> bool:
    verdict = str(entry["verdict"])
    narrowed = float(entry["std"]) < DETERMINED * float(entry["std_before"])
    return verdict.startswith(DETERMINED_WORD) or (verdict.startswith(CONTRADICTED) and narrowed)


def _change(vehicle: Vehicle, name: str, entry: Mapping[str, Any], *, relative: bool) -> Change:
    """Return what becomes of coefficient `name` by one parameter's value and 1-sigma."""
    before, std_before, verdict = vehicle[name], vehicle.std(name), str(entry["verdict"])
    scale = before if relative else 1.0
    value = _rounded(before + scale * (float(entry["value"]) - float(entry["before"])))
    std = _rounded(abs(scale) * float(entry["std"]))
    if not _is_determined(entry):
        return Change(name, before, std_before, before, std_before, False, f"kept: {verdict}")
    try:
        check_value(name, value, FILE)
    except InputError as error:
        return Change(name, before, std_before, before, std_before, False, f"kept: {error}")
    if not (math.isfinite(value) and math.isfinite(std)):
        return Change(name, before, std_before, before, std_before, False, "kept: no value or no 1-sigma was found")
    return Change(name, before, std_before, value, std, True, verdict)


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _changed(vehicle: Vehicle, name: str, changes: list[Change], correlation: Mapping[str, Any]) -> Vehicle:
    """Return the vehicle with `changes`, the errors of two of them correlated as the adjustment found."""
    new = [change for change in changes if change.changed]
    if not new:
        return vehicle
    coefficients = dict(vehicle.coefficients)
    for change in new:
        was = vehicle.coefficients[change.name].source if change.name in vehicle.coefficients else "default"
        before = f"before {change.before:g} ± {change.std_before:g} ({was})"
        source = f"{made_by(name)} adjusted to its depth rate, {change.why}; {before}"
        coefficients[change.name] = Coefficient(change.value, change.std, KNOWN[change.name].unit, source)
    touched = {change.name for change in new}
    kept = {pair: value for pair, value in vehicle.correlations.items() if not touched & set(pair)}
    return replace(
        vehicle,
        name=f"{vehicle.name}-{name}",
        coefficients=coefficients,
        correlations=kept | _correlations(vehicle, [change.name for change in new], correlation),
    )


def _correlations(vehicle: Vehicle, names: list[str], found: Mapping[str, Any]) -> dict[tuple[str, str], float]:
    """Return the correlations of the changed coefficients; K_1 and K_2 share one factor on thrust."""
    parameter = {name: parameter for parameter, names in SHARES.items() for name in names}
    order = list(found.get("names", ()))
    pairs = {}
    for k, first in enumerate(names):
        for second in names[k + 1 :]:
            one, other = parameter.get(first, first), parameter.get(second, second)
            sign = 1.0
            for name in (first, second):
                sign *= math.copysign(1.0, vehicle[name]) if name in parameter else 1.0
            if one == other:
                pairs[first, second] = sign
            elif one in order and other in order:
                value = float(found["matrix"][order.index(one)][order.index(other)])
                pairs[first, second] = round(sign * value, DECIMALS)
    return pairs


def _ballast(mission: Mission, vehicle: Vehicle, entry: Mapping[str, Any] | None, neutral_density: float) -> str:
    """Return the key ``ballast`` of mission.yaml with the net buoyancy found, empty where it cannot be told.

    A change ΔG of net buoyancy is one of volume by the factor 1 + ΔG/(g m), and of the neutral density by its inverse.
    """
    if entry is None or not _is_determined(entry):
        return ""
    given = mission.ballast
    mass = given.mass or vehicle["mass"]
    factor = 1.0 + (float(entry["value"]) - float(entry["before"])) / (GRAVITY * mass)
    density = given.neutral_density or neutral_density
    if not math.isfinite(factor):
        return ""
    keys = {"mass": f"{given.mass:g}"} if given.mass is not None else {}
    if given.volume is not None:
        keys["volume"] = f"{given.volume * factor:.8g}"
    elif math.isfinite(density):
        keys["neutral_density"] = f"{density / factor:.8g}"
    else:
        return ""
    keys["std"] = f"{float(entry['std']):.2g}"
    return f"ballast: {{{', '.join(f'{key}: {value}' for key, value in keys.items())}}}"


def _remarks(found: Mapping[str, Any]) -> list[str]:
    """Return what was found that is not the vehicle's."""
    remarks = []
    for name, meaning, unit in (
        ("net_buoyancy", "net buoyancy differs by", "N"),
        ("hull_time", "the hull takes on the temperature of the water in", "s"),
        ("carried_water", "the fairing carries water along,", "of the hull's volume"),
        ("flushing_time", "and renews it in", "s"),
    ):
        if name in found:
            entry = found[name]
            size = amount(entry["value"], entry["std"], sign=unit == "N")
            remarks.append(f"{meaning} {size} {unit}: {entry['verdict']}")
    left = [name.replace("_", " ") for name, entry in found.items() if str(entry["verdict"]).startswith(CONSIDERED)]
    if left:
        remarks.append(f"never adjusted, their 1-sigma is in that of the rest: {', '.join(left)}")
    return remarks


def text(corrected: Corrected, mission: str) -> str:
    """Return the vehicle file: comments, then YAML that `vehicle.load` reads."""
    new = [change for change in corrected.changes if change.changed]
    said = f"changed: {', '.join(change.name for change in new)}" if new else "no coefficient is changed"
    lines = [
        f"The vehicle as corrected by mission {mission}; {said}.",
        f"For other missions: put it beside mission.yaml and write 'vehicle: {FILE}' there. A mission that it was",
        "corrected by would use its own data twice.",
        *(f"{change.name}: {change.why}" for change in corrected.changes if not change.changed),
        *corrected.remarks,
    ]
    if corrected.ballast:
        lines += ["For a mission with the same ballast, in mission.yaml:", f"  {corrected.ballast}"]
    vehicle = corrected.vehicle
    out = [f"# {line}" for line in lines]
    out += [f"name: {_text(vehicle.name)}", f"description: {_text(vehicle.description)}", "coefficients:"]
    for name, item in vehicle.coefficients.items():
        fields = (f"value: {_number(item.value)}", f"std: {_number(item.std)}", f"unit: {_text(item.unit)}")
        assumed = ", assumed: true" if item.assumed else ""
        out.append(f"  {name}: {{{', '.join(fields)}{assumed}, source: {_text(item.source)}}}")
    if vehicle.correlations:
        out.append("correlations:")
        for first in dict.fromkeys(pair[0] for pair in vehicle.correlations):
            row = {pair[1]: value for pair, value in vehicle.correlations.items() if pair[0] == first}
            out.append(f"  {first}: {{{', '.join(f'{name}: {_number(value)}' for name, value in row.items())}}}")
    return "\n".join(out) + "\n"


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)


def _number(value: float) -> str:
    """Return a number as YAML 1.1 knows it, with a point before the exponent; 'unknown' for NaN."""
    if math.isnan(value):
        return "unknown"
    mantissa, exponent, power = repr(float(value)).partition("e")
    return f"{mantissa if '.' in mantissa else f'{mantissa}.0'}{exponent}{power}"


def account(corrected: Corrected) -> dict[str, Any]:
    """Return the part of summary.json that tells what of the vehicle was changed."""
    return {
        "vehicle": corrected.vehicle.name,
        "changes": [{**vars(change), "unit": KNOWN[change.name].unit} for change in corrected.changes],
        "ballast": corrected.ballast,
        "remarks": list(corrected.remarks),
    }
