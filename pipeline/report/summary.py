"""summary.json: everything that the page says, as numbers with units for a script."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pandas as pd

from pipeline.report import compare, corrected, inventory, methods, misses, nominal, og1, stored
from pipeline.report.adjustment import adjustment
from pipeline.report.answer import answer
from pipeline.report.closures import closures, of_mission
from pipeline.report.compatibility import compatibility
from pipeline.report.currents import currents
from pipeline.report.fitting.account import told
from pipeline.report.fitting.constraint import told_by
from pipeline.report.fitting.counterpart import counterpart
from pipeline.report.fitting.fit import fit, solvable
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.hypotheses import rank
from pipeline.report.fitting.points import Configuration
from pipeline.report.fitting.sea import sea

if TYPE_CHECKING:
    from pipeline.report import Inputs


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
    given = Given(
        settings=settings,
        ballast_std=nominal.ballast_std(mission, inputs.estimate),
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
    data = inventory.data(inputs.records)
    told = methods.paragraph(inputs, fitted, gps=gps is not None, sensor_used=sensor_used)
    summary: dict[str, Any] = {
        "mission": mission.slug,
        "description": mission.description,
        "vehicle": inventory.coefficients(inputs.vehicle),
        "format": inputs.ingest.get("format", ""),
        "data": data,
        "compatibility": compatibility(inputs.estimate, sensor_used=sensor_used),
        "observability": inventory.observability(inputs.estimates),
        "blocks": inventory.steady(blocks),
        "parts": trial,
        "comparison": misses.errors(comparison, inputs.predictions, settings),
        "stability": misses.stability(blocks, inputs.predictions),
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
        "findings": inventory.findings(inputs),
        "borrowed": methods.borrowed(inputs, gps=gps is not None, sensor_used=sensor_used),
        "methods": told,
        "citations": methods.citations(told, inputs.vehicle),
        "provenance": inventory.provenance(inputs.provenance),
    }
    summary["answer"] = answer(summary)
    summary["key_numbers"] = _key_numbers(summary)
    return summary, comparison


def _consistency(estimate: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what the consistency report says of each estimate, its method by name."""
    found: Mapping[str, Any] = estimate.get("consistency") or {}
    return [
        {"method": method, **report}
        for method, report in found.items()
        if isinstance(report, Mapping) and "innovations" in report
    ]


def _key_numbers(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the numbers of the first table: name, value, 1-sigma, unit, a remark, and whether it is a difference."""

    def row(
        name: str, value: Any, unit: str, std: float = math.nan, remark: str = "", *, signed: bool = False
    ) -> dict[str, Any]:
        return {"name": name, "value": value, "std": std, "unit": unit, "remark": remark, "signed": signed}

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
        value, spread = (item["value"], item["std"]) if told(item["std"], item["prior_std"]) else (math.nan, math.nan)
        rows.append(row(item["symbol"], value, item["unit"], spread, item["verdict"], signed=True))
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
            rows.append(row(f"{name}, {method}", 100.0 * sensor[key], unit, remark=remark, signed=key == "bias"))
    return rows
