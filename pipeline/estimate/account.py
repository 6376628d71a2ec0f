"""The account of a whole mission: what its parts say, added up, and every finding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import reduce
from typing import Any

import numpy as np

from pipeline.estimate.blocks import NO_ENGINE
from pipeline.estimate.compatibility import Entry, quantity, speed_scale
from pipeline.estimate.consistency import report as consistency
from pipeline.estimate.legs import flown
from pipeline.estimate.part import Part
from pipeline.estimate.preparation import Prepared
from pipeline.estimate.sensors import Scale
from pipeline.estimate.settings import Settings
from pipeline.estimate.together import together
from pipeline.findings import Finding

#: The two estimates disagree where the water of one moves by so many times as much as the other's, whose error of net
#: buoyancy is as many times what is usual.
DISAGREEING = 3.0


def account(parts: Sequence[Part], prepared: Prepared) -> tuple[dict[str, Any], list[Finding]]:
    """Return what is said of the whole mission, and every finding.

    Parameters
    ----------
    parts
        All parts, in order; their estimates are not looked at.
    prepared
        What they had in common.
    """
    model, adjusted = prepared.kinematic, prepared.adjusted
    judged = {}
    for method in dict.fromkeys(method for part in parts for method in part.tallies):
        total = reduce(lambda a, b: a + b, [part.tallies[method] for part in parts if method in part.tallies])
        judged[method] = consistency(total)
    seen, size = _sum(parts, "kinematic")
    shares = np.sum([part.shares for part in parts], axis=0)
    turned = any(np.isfinite((model.noise.settings.turn_drift, model.noise.settings.turn_drift_manoeuvre)))
    report: dict[str, Any] = {
        "observable_share": seen / size,
        "reasons": _reasons(parts, "kinematic"),
        "consistency": judged,
        "coverage": judged["kinematic"]["sensor"],
        "gps": flown([leg for part in parts for leg in part.legs]) if model.sources.fixes else None,
        "share_of_variance": {
            name: float(share) / seen if seen else None for name, share in zip(model.open, shares, strict=True)
        },
        "settings": model.noise.settings._asdict()
        | {"engine": prepared.engine, "pitch_std_deg": prepared.mission.pitch.std_deg},
        "used": {"speed_sensor": model.sources.speed, "fixes": model.sources.fixes, "pitch_rate": turned},
        "compatibility": {
            "clock_offset": prepared.clocks,
            **_joined(parts),
        },
    }
    report["speed_scale"] = {
        name: _scale(
            [part.scales[name] for part in parts if name in part.scales], prepared.mission.speed_sensor_scale_std
        )
        for name in ("kinematic", "force")
        if any(name in part.scales for part in parts)
    }
    report["ballast"] = None if prepared.body is None else asdict(prepared.body)
    report["force"] = {"reason": prepared.reason}
    if adjusted is not None:
        seen, size = _sum(parts, "force")
        report["force"] |= {
            **adjusted.report,
            "observable_share": seen / size if size else 0.0,
            "reasons": _reasons(parts, "force"),
            "settings": adjusted.noise.settings._asdict(),
        }
    findings = list(prepared.findings)
    if adjusted is not None:
        findings += as_buoyancy(model.noise.settings, adjusted.noise.settings)
    if not any(part.engine for part in parts):
        findings.append(NO_ENGINE)
    for finding in (item for part in parts for item in part.findings):
        if finding not in findings:
            findings.append(finding)
    return report, findings


def _sum(parts: Sequence[Part], method: str) -> tuple[int, int]:
    counts = [part.observable.get(method, (0, 0)) for part in parts]
    return sum(seen for seen, _ in counts), sum(size for _, size in counts)


def _reasons(parts: Sequence[Part], method: str) -> dict[str, int]:
    total: dict[str, int] = {}
    for part in parts:
        for text, count in part.reasons.get(method, {}).items():
            total[text] = total.get(text, 0) + count
    return dict(sorted(total.items()))


def _joined(parts: Sequence[Part]) -> dict[str, Any]:
    """Return what the parts say of each quantity together; outliers are summed."""
    result = {}
    for name in parts[0].compatibility:
        entries = [part.compatibility[name] for part in parts]
        if name == "outliers":
            total = {key: dict(value) for key, value in entries[0]["instruments"].items()}
            for entry in entries[1:]:
                for key, value in entry["instruments"].items():
                    had = total.setdefault(key, {"count": 0, "first": []})
                    had["count"] += value["count"]
            count = sum(entry["value"] or 0 for entry in entries)
            result[name] = {**entries[0], "value": count, "instruments": total}
        else:
            result[name] = _whole(entries)
    return result


def _whole(entries: Sequence[Entry]) -> Entry:
    """Return what the entries of the parts for one quantity come to, with ``parts``; the one of a mission in one."""
    whole = together([(entry["value"], entry["std"]) if _known(entry) else None for entry in entries])
    if whole is None or len(entries) == 1:
        return entries[0]
    best = min(filter(_known, entries), key=lambda entry: float(entry["std"]))
    entry = quantity(best["unit"], whole.value, whole.std, nominal=best["nominal"])
    applied = sum(entry["applied"] for entry in entries)
    entry["significant"] |= applied > 0
    if applied:
        entry["reason"] = f"each part by itself, applied in {applied} of {len(entries)}"
    return entry | {"applied": applied > 0, "parts": whole.account}


def _known(entry: Entry) -> bool:
    return entry["value"] is not None and bool(entry["std"])


def _scale(found: Sequence[Scale | None], before: float) -> Entry:
    """Return the report on the scale error of a speed sensor by all parts; `before` is its 1-sigma before them."""
    whole = together(found)
    if whole is None or len(found) == 1:
        return speed_scale(found[0], before)
    return speed_scale(Scale(whole.value, whole.std), before) | {"parts": whole.account}


def as_buoyancy(kinematic: Settings, force: Settings) -> list[Finding]:
    """Return a warning where the force estimate may take waves in the water for an error of net buoyancy.

    Waves that last for as long as an error of net buoyancy may do, and lift the isopycnals along, look like one to it;
    the kinematic estimate, which knows no buoyancy, finds them in the water.
    """
    if kinematic.sigma_w < DISAGREEING * force.sigma_w or force.load < DISAGREEING * Settings().load:
        return []
    return [
        Finding(
            "warning",
            "force estimate",
            "",
            f"an error of net buoyancy that comes and goes by {force.load:.2f} N, and water that moves by "
            f"{100.0 * force.sigma_w:.1f} cm/s",
            f"water that moves by {100.0 * kinematic.sigma_w:.1f} cm/s, as the kinematic estimate has it",
            "it may take waves for buoyancy, with intervals that are too narrow; those of the kinematic estimate hold",
        )
    ]


def nothing() -> dict[str, Any]:
    """Return the report on a mission without records."""
    return {
        "observable_share": 0.0,
        "reasons": {},
        "consistency": {},
        "coverage": None,
        "gps": None,
        "share_of_variance": {},
        "settings": {},
        "used": {"speed_sensor": False, "fixes": False, "pitch_rate": False},
        "compatibility": {},
        "speed_scale": {},
        "ballast": None,
        "force": {"reason": "no records"},
    }
