"""What a mission's tables and files hold, as numbers with units for summary.json."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pipeline.findings import Finding
from pipeline.records import seconds, timestamps
from pipeline.report import og1
from pipeline.report.compare import DIRECTIONS, floats
from pipeline.report.corrected import made_by
from pipeline.vehicle import KNOWN, Vehicle

if TYPE_CHECKING:
    from pipeline.report import Inputs
    from pipeline.table import Columns

#: Makes of gliders whose files, and whose vehicle files, are known by their names.
MAKES = ("slocum", "seaglider", "seaexplorer", "spray")
_SERIAL = re.compile(r"sea\d{3}\.")


def coefficients(vehicle: Vehicle) -> dict[str, Any]:
    """Return the vehicle and each coefficient with its 1-sigma, unit and source."""
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


def data(records: Columns) -> dict[str, Any]:
    """Return how many records there are, from when to when, how many dives, and how deep."""
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


def observability(estimates: Columns) -> dict[str, Any]:
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


def steady(blocks: pd.DataFrame) -> dict[str, Any]:
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


def findings(inputs: Inputs) -> list[dict[str, str]]:
    """Return what every stage found, the gravest first."""
    rank = {"error": 0, "warning": 1, "note": 2}
    listed = [
        {"stage": stage, **{key: str(value) for key, value in finding.items()}}
        for stage, report in (("ingest", inputs.ingest), ("estimate", inputs.estimate))
        for finding in report.get("findings", [])
    ]
    own = (*_of_another(inputs), *_of_itself(inputs), *_without_dives(inputs))
    listed += [{"stage": "report", **finding.as_dict()} for finding in own]
    unwritten = og1.missing()
    if unwritten is not None:
        listed.append({"stage": "report", **unwritten.as_dict()})
    return sorted(listed, key=lambda row: rank.get(row.get("severity", ""), 3))


def _of_another(inputs: Inputs) -> list[Finding]:
    """Return a warning where the logs are those of one make of glider and the vehicle, by its name, is of another."""
    make = next((make for make in MAKES if inputs.vehicle.name.startswith(make)), "")
    stages: Mapping[str, Any] = inputs.provenance.get("stages") or {}
    read: Mapping[str, Any] = (stages.get("ingest") or {}).get("inputs") or {}
    logged = inputs.ingest.get("format", "")
    if any(_SERIAL.match(name.lower()) for name in read):
        logged = "seaexplorer"
    if not make or logged not in MAKES or make == logged:
        return []
    found, expected = f"'{inputs.vehicle.name}' and files of a {logged}", f"a {logged}"
    return [
        Finding("warning", "mission.yaml", "vehicle", found, expected, "its lift, drag and mass are those of another")
    ]


def _of_itself(inputs: Inputs) -> list[Finding]:
    """Return a warning where the vehicle has coefficients that were fitted to this very mission."""
    coefficients = inputs.vehicle.coefficients
    fitted = [name for name, item in coefficients.items() if made_by(inputs.mission.slug) in item.source]
    if not fitted:
        return []
    found, expected = f"{', '.join(fitted)} fitted to this mission", "what was known before it"
    remedy = "theory is compared with what it was fitted to, and every 1σ is too small: name it for other missions"
    return [Finding("warning", "mission.yaml", "vehicle", found, expected, remedy)]


def _without_dives(inputs: Inputs) -> list[Finding]:
    """Return a warning about each configuration of mission.yaml that has dives which were not flown."""
    last = int(np.nanmax(floats(inputs.records, "dive"), initial=0.0))
    return [
        Finding(
            "warning",
            "mission.yaml",
            f"configurations: {item.name}",
            f"dives {item.dives[0]} to {item.dives[1]}",
            f"dives from 1 to {last}",
            "the configuration has no dive" if item.dives[0] > last else "it ends with the last",
        )
        for item in inputs.mission.configurations
        if item.dives[1] > last
    ]


def provenance(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return the input hashes and the versions."""
    stages: Mapping[str, Any] = provenance.get("stages") or {}
    read: Mapping[str, Any] = (stages.get("ingest") or {}).get("inputs") or {}
    software = next((dict(stage["software"]) for stage in stages.values() if stage.get("software")), {})
    software.pop("code", None)
    return {
        "inputs": [{"file": name, "blake2b": digest} for name, digest in sorted(read.items())],
        "software": [{"name": name, "version": str(version)} for name, version in software.items()],
    }
