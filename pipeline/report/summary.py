"""summary.json: everything that the page says, as numbers with units for a script."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pipeline.records import TRIMS, seconds, timestamps
from pipeline.report import averages, compare, corrected, methods, nominal, og1, stored
from pipeline.report.adjustment import adjustment
from pipeline.report.answer import answer
from pipeline.report.closures import closures, of_mission
from pipeline.report.compare import DIRECTIONS, QUANTITIES, floats
from pipeline.report.compatibility import compatibility
from pipeline.report.currents import currents
from pipeline.report.fitting.constraint import told_by
from pipeline.report.fitting.counterpart import counterpart
from pipeline.report.fitting.fit import fit, solvable
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.hypotheses import rank
from pipeline.report.fitting.points import Configuration
from pipeline.report.fitting.sea import sea
from pipeline.vehicle import KNOWN, Vehicle

if TYPE_CHECKING:
    from pipeline.report import Inputs
    from pipeline.table import Columns

TRIM_WORDS = {
    "pitch": "measured pitch held",
    "battery": "moment balance with the battery as logged",
    "fixed_alpha": "pitch left free, α = −K_M0/K_M",
}


def summarise(inputs: Inputs) -> tuple[dict[str, Any], pd.DataFrame]:
    """Return the content of summary.json, and the table of comparisons that the figures are drawn from."""
    mission, blocks, settings = inputs.mission, inputs.blocks, inputs.estimate.get("settings")
    used = inputs.estimate.get("used") or {}
    sensor_used = bool(used.get("speed_sensor", mission.speed_sensor == "use"))
    level = bool(((blocks["direction"] == 0) & blocks["powered"]).any())
    gps = nominal.gps_speed(inputs.estimate) if level else None
    comparison = compare.compare(
        blocks, inputs.predictions, inputs.vehicle, sensor_used=sensor_used, settings=settings, gps=gps
    )
    means = averages.means(comparison, settings)
    given = Given(
        settings=settings,
        ballast_std=mission.ballast.std,
        pitch_std=math.radians(mission.pitch.std_deg),
        use_sensor=sensor_used,
        gps=gps,
        configurations=tuple(Configuration(item.name, *item.dives) for item in mission.configurations),
    )
    given = replace(given, settings=sea(blocks, inputs.vehicle, given))
    passages = of_mission(inputs)
    begin, reason = solvable(blocks, inputs.vehicle, given)
    if not reason and mission.gps != "ignore" and gps is None:
        given = replace(given, constraints=told_by(passages, begin.model))
    fitted = fit(blocks, inputs.vehicle, given)
    fitted["counterpart"] = counterpart(fitted, inputs.estimate.get("force") or {}, sensor_used=sensor_used)
    trial = nominal.table(mission, inputs.vehicle, blocks, comparison, inputs.estimate)
    model = stored.check(
        inputs.stored,
        blocks,
        inputs.records,
        constants=inputs.ingest.get("constants"),
        settings=settings,
        sensor="speed sensor (ADCP)" if inputs.ingest.get("format") == "seaglider" else "speed sensor",
    )
    data = _data(inputs.records)
    summary: dict[str, Any] = {
        "mission": mission.slug,
        "description": mission.description,
        "vehicle": _vehicle(inputs.vehicle),
        "format": inputs.ingest.get("format", ""),
        "data": data,
        "compatibility": compatibility(inputs.estimate, sensor_used=sensor_used),
        "observability": _observability(inputs.estimates),
        "blocks": _blocks(blocks),
        "parts": trial,
        "comparison": {
            "means": [_mean(row) for row in means.to_dict("records")],
            "even_odd": [_even_odd(row) for row in averages.parity(comparison, settings).to_dict("records")],
            "no_prediction": _no_prediction(inputs.predictions),
            "blocks": _per_block(comparison),
        },
        "stability": _stability(blocks, inputs.predictions),
        "fit": fitted,
        "closure": closures(inputs, passages),
        "current": currents(inputs, passages),
        "hypotheses": rank(blocks, inputs.vehicle, given),
        "stored_model": model,
        "force": adjustment(inputs.estimate, sensor_used=sensor_used, depth=data["depth_max_m"]),
        "sensor": inputs.estimate.get("coverage"),
        "gps": inputs.estimate.get("gps"),
        "estimator": {"settings": settings, "consistency": inputs.estimate.get("consistency"), "used": used},
        "consistency": _consistency(inputs.estimate),
        "export": {
            **corrected.account(corrected.of_mission(inputs)),
            "netcdf": og1.missing() is None and data["rows"] > 0,
        },
        "findings": _findings(inputs),
        "borrowed": methods.borrowed(inputs, gps=gps is not None, sensor_used=sensor_used),
        "methods": methods.paragraph(inputs, fitted, gps=gps is not None, sensor_used=sensor_used),
        "citations": methods.CITATIONS,
        "provenance": _provenance(inputs.provenance),
    }
    summary["answer"] = answer(summary)
    summary["key_numbers"] = _key_numbers(summary)
    return summary, comparison


def _vehicle(vehicle: Vehicle) -> dict[str, Any]:
    return {
        "name": vehicle.name,
        "description": vehicle.description,
        "coefficients": [
            {
                "name": name,
                "symbol": KNOWN[name].symbol,
                "meaning": KNOWN[name].meaning,
                "value": item.value,
                "std": item.std,
                "unit": item.unit,
                "source": item.source,
            }
            for name, item in vehicle.coefficients.items()
        ],
    }


def _data(records: Columns) -> dict[str, Any]:
    if records.empty:
        return {"rows": 0, "start": "", "end": "", "duration_h": 0.0, "dives": 0, "depth_max_m": math.nan}
    time = seconds(records["time"])
    first, last = (timestamps(np.array([instant]))[0] for instant in (time[0], time[-1]))
    dive, depth = records["dive"].to_numpy(), floats(records, "depth")
    return {
        "rows": len(records),
        "start": f"{first:%Y-%m-%dT%H:%M:%SZ}",
        "end": f"{last:%Y-%m-%dT%H:%M:%SZ}",
        "duration_h": float(time[-1] - time[0]) / 3600.0,
        "dives": int(np.unique(dive[dive > 0]).size),
        "depth_max_m": float(np.nanmax(depth)) if np.isfinite(depth).any() else math.nan,
    }


def _observability(estimates: Columns) -> dict[str, Any]:
    """Return the share of the samples in which the data determine the speed, and why not in the others."""
    if estimates.empty:
        return {"samples": 0, "observable_percent": 0.0, "reasons": []}
    seen = estimates["observable"].to_numpy(dtype=bool)
    counts = estimates["reason"].astype("category")[~seen].value_counts(sort=False).sort_index()
    reasons = [
        {"reason": reason or "no reason given", "samples": int(count), "percent": 100.0 * count / len(estimates)}
        for reason, count in counts[counts > 0].items()
    ]
    return {
        "samples": len(estimates),
        "observable_percent": 100.0 * float(seen.mean()),
        "reasons": sorted(reasons, key=lambda row: (-row["samples"], row["reason"])),
    }


def _consistency(estimate: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what the consistency report says of each estimate, its method by name."""
    found: Mapping[str, Any] = estimate.get("consistency") or {}
    return [
        {"method": method, **report}
        for method, report in found.items()
        if isinstance(report, Mapping) and "innovations" in report
    ]


def _blocks(blocks: pd.DataFrame) -> dict[str, Any]:
    """Return how many steady blocks there are, how many are used, and why the others are not."""
    if blocks.empty:
        return {"total": 0, "used": 0, "used_h": 0.0, "left_out": [], "groups": []}
    used = blocks["used"].to_numpy(dtype=bool)
    length = seconds(blocks["end"]) - seconds(blocks["start"])
    counts = blocks.loc[~used, "reason"].astype(str).value_counts(sort=False).sort_index()
    groups = [
        {
            "direction": DIRECTIONS[int(group["direction"].iloc[0])],
            "powered": bool(group["powered"].iloc[0]),
            "blocks": len(group),
        }
        for _key, group in blocks[used].groupby(["direction", "powered"], sort=True)
    ]
    return {
        "total": len(blocks),
        "used": int(used.sum()),
        "used_h": float(length[used].sum()) / 3600.0,
        "left_out": [{"reason": reason or "no reason given", "blocks": int(n)} for reason, n in counts.items()],
        "groups": groups,
    }


def _in_units(quantity: str) -> tuple[float, str]:
    """Return the factor from SI and the unit in which a quantity is shown."""
    return (180.0 / math.pi, "deg") if quantity in ("pitch", "path_angle") else (100.0, "cm/s")


def _mean(row: Mapping[Any, Any]) -> dict[str, Any]:
    factor, unit = _in_units(row["quantity"])
    scaled = {name: factor * row[name] for name in ("predicted", "measured", "measured_std", "error", "u_val")}
    return {
        "trim": row["trim"],
        "trim_meaning": TRIM_WORDS[row["trim"]],
        "quantity": row["quantity"],
        "quantity_meaning": QUANTITIES[row["quantity"]],
        "flight": _flight(int(row["direction"]), bool(row["powered"])),
        "blocks": row["blocks"],
        "dives": row["dives"],
        "unit": unit,
        **scaled,
        "relative_error_percent": 100.0 * row["relative_error"] if unit == "cm/s" else math.nan,
        "significance": row["significance"],
        "label": row["label"],
        "why": row["why"],
    }


def _even_odd(row: Mapping[Any, Any]) -> dict[str, Any]:
    factor, unit = _in_units(row["quantity"])
    return {
        "trim": row["trim"],
        "trim_meaning": TRIM_WORDS[row["trim"]],
        "quantity": row["quantity"],
        "quantity_meaning": QUANTITIES[row["quantity"]],
        "powered": bool(row["powered"]),
        "dives": row["dives"],
        "unit": unit,
        **{name: factor * row[name] for name in ("even", "even_u", "odd", "odd_u")},
    }


def _flight(direction: int, powered: bool) -> str:
    return DIRECTIONS[direction] + (" under propeller" if powered else "")


def _no_prediction(predictions: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the trims that have no prediction for some block, and why."""
    out = []
    for trim in TRIMS:
        rows = predictions[(predictions["trim"] == trim) & ~np.isfinite(floats(predictions, "speed"))]
        counts = rows["reason"].astype(str).value_counts(sort=False).sort_index()
        out += [
            {"trim": trim, "trim_meaning": TRIM_WORDS[trim], "reason": reason or "no reason given", "blocks": int(n)}
            for reason, n in counts.items()
        ]
    return out


def _per_block(comparison: pd.DataFrame) -> dict[str, Any]:
    """Return every comparison as columns, in SI units and radians, six digits."""
    columns: dict[str, Any] = {
        "unit": "SI: m/s and rad",
        **{name: comparison[name].tolist() for name in ("block", "dive", "direction", "powered", "trim", "quantity")},
    }
    for name in ("predicted", "measured", "error", "u_num", "u_input", "u_measured", "covariance", "u_val"):
        columns[name] = [float(f"{value:.6g}") for value in floats(comparison, name)]
    columns["label"] = comparison["label"].tolist()
    return columns


def _stability(blocks: pd.DataFrame, predictions: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the stable range of the paper's inequalities at the pitch held, beside the measured speed."""
    used = blocks[blocks["used"].to_numpy(dtype=bool)]
    held = predictions[predictions["trim"] == "pitch"]
    both = used.merge(held, on="block", suffixes=("", "_theory"))
    both = both[np.isfinite(floats(both, "speed_theory"))]
    rows = []
    for _key, group in both.groupby(["direction", "powered"], sort=True):
        low, high, speed = (floats(group, name) for name in ("speed_lower", "speed_upper", "speed"))
        known = np.isfinite(low) & np.isfinite(high) & np.isfinite(speed)
        rows.append(
            {
                "flight": _flight(int(group["direction"].iloc[0]), bool(group["powered"].iloc[0])),
                "blocks": len(group),
                "speed_lower_m_s": _median(low),
                "speed_upper_m_s": _median(high),
                "measured_speed_m_s": _median(speed),
                "measured_inside_percent": (
                    100.0 * float(np.mean((speed > low)[known] & (speed < high)[known])) if known.any() else math.nan
                ),
                "all_inequalities_percent": 100.0 * float(group["stable"].to_numpy(dtype=bool).mean()),
            }
        )
    return rows


def _median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else math.nan


def _findings(inputs: Inputs) -> list[dict[str, str]]:
    """Return what every stage found, the gravest first."""
    rank = {"error": 0, "warning": 1, "note": 2}
    listed = [
        {"stage": stage, **{key: str(value) for key, value in finding.items()}}
        for stage, report in (("ingest", inputs.ingest), ("estimate", inputs.estimate))
        for finding in report.get("findings", [])
    ]
    unwritten = og1.missing()
    if unwritten is not None:
        listed.append({"stage": "report", **unwritten.as_dict()})
    return sorted(listed, key=lambda row: rank.get(row.get("severity", ""), 3))


def _provenance(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return the input hashes and the versions."""
    stages: Mapping[str, Any] = provenance.get("stages") or {}
    read: Mapping[str, Any] = (stages.get("ingest") or {}).get("inputs") or {}
    software = next((dict(stage["software"]) for stage in stages.values() if stage.get("software")), {})
    software.pop("code", None)
    return {
        "inputs": [{"file": name, "blake2b": digest} for name, digest in sorted(read.items())],
        "software": [{"name": name, "version": str(version)} for name, version in software.items()],
    }


def _key_numbers(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the numbers of the first table: name, value, 1-sigma, unit and a remark."""

    def row(name: str, value: Any, unit: str, std: float = math.nan, remark: str = "") -> dict[str, Any]:
        return {"name": name, "value": value, "std": std, "unit": unit, "remark": remark}

    data, blocks = summary["data"], summary["blocks"]
    rows = [
        row("duration", data["duration_h"], "h", remark=f"{data['start']} to {data['end']}"),
        row("dives", data["dives"], ""),
        row("greatest depth", data["depth_max_m"], "m"),
        row("steady blocks used", blocks["used"], "", remark=f"of {blocks['total']}; {blocks['used_h']:.1f} h"),
        row("speed observable", summary["observability"]["observable_percent"], "%", remark="of the samples"),
    ]
    for part in summary["parts"]:
        remark = part["measured_from"] or part["measured_reason"]
        measured, spread = part["measured_speed_m_s"], part["measured_speed_std_m_s"]
        rows.append(row(f"speed, {part['name']}", measured, "m/s", spread, remark))
    for item in summary["fit"]["parameters"]:
        rows.append(row(item["symbol"], item["value"], item["unit"], item["std"], item["verdict"]))
    for judged in summary["consistency"]:
        sensor, method = judged["sensor"], judged["method"]
        if not sensor:
            continue
        for name, key in (
            ("RMSE against the speed sensor", "rmse"),
            ("bias against the speed sensor", "bias"),
            ("95 % interval covers", "coverage95"),
        ):
            unit = "%" if key == "coverage95" else "cm/s"
            remark = f"{method} estimate, {sensor['n']} instants, held out"
            rows.append(row(f"{name}, {method}", 100.0 * sensor[key], unit, remark=remark))
    return rows
