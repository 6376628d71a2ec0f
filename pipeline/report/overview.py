"""The overview of a campaign: what index.html says, as numbers for a script, from the summaries of its missions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from pipeline.records import Column, conform
from pipeline.report.compare import SIGNIFICANT
from pipeline.report.fitting.account import told
from pipeline.report.fleet import fleet
from pipeline.report.propulsion import strength

if TYPE_CHECKING:
    import pandas as pd

#: Share of observable samples below which a cell is flagged, %.
OBSERVABLE = 50.0
#: Corrections of the fit that the force estimate adjusts too, by its name for them.
ADJUSTED = {"parasite_drag": "parasite_drag", "net_buoyancy": "net_buoyancy", "thrust_scale": "thrust"}
#: Their symbols where the fit has not freed them.
SYMBOLS = {"parasite_drag": "ΔK_D0", "net_buoyancy": "ΔG", "thrust_scale": "Δscale_T"}


class Key(NamedTuple):
    """A column of the table: where it is kept, its heading, decimals, whether signed, and the column of its 1-sigma."""

    column: Column
    heading: str
    digits: int = 0
    sign: bool = False
    std: Column | None = None

    @property
    def text(self) -> bool:
        """Whether it holds words."""
        return self.column.dtype == "string"


def _with_std(name: str, unit: str, meaning: str, heading: str, digits: int, *, sign: bool = True) -> Key:
    std = Column(f"{name}_std", unit, f"1-sigma of {name}")
    return Key(Column(name, unit, meaning), heading, digits, sign, std)


KEYS = (
    Key(Column("mission", "", "name of the mission", "string"), "mission"),
    Key(Column("vehicle", "", "vehicle", "string"), "vehicle"),
    Key(Column("start", "", "first record, UTC", "string"), "start"),
    Key(Column("duration_h", "h", "from the first record to the last"), "duration", 1),
    Key(Column("dives", "", "dives", "int32"), "dives"),
    Key(Column("blocks", "", "steady blocks that are used", "int32"), "blocks"),
    Key(Column("observable_percent", "%", "samples in which the data determine the speed"), "observable"),
    _with_std("measured_m_s", "m/s", "measured speed of the part with the most propeller", "measured V", 3, sign=False),
    Key(Column("theory_m_s", "m/s", "theory of the same blocks, measured pitch held"), "theory V", 3),
    Key(
        Column("error_cm_s", "cm/s", "E, theory less measured"), "E ± u_val", 1, True,
        Column("error_cm_s_std", "cm/s", "u_val, validation uncertainty of error_cm_s"),
    ),
    Key(Column("significance", "", "|E|/u_val"), "|E|/u_val", 1),
    _with_std("drag_percent", "%", "parasite drag less the vehicle file's, fitted to blocks", "ΔK_D0", 1),
    _with_std("force_drag_percent", "%", "the same as the force estimate was adjusted", "ΔK_D0, force", 1),
    _with_std("ballast_N", "N", "constant part of net buoyancy, fitted to blocks", "ΔG", 2),
    _with_std("force_ballast_N", "N", "the same as the force estimate was adjusted", "ΔG, force", 2),
    Key(Column("warnings", "", "errors and warnings among the findings", "int32"), "warnings"),
)  # fmt: skip


def overview(summaries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the content of index.json.

    Parameters
    ----------
    summaries
        The content of each summary.json; of a mission that failed, ``{"mission": name, "error": line}``.

    Returns
    -------
    dict
        ``missions`` (key numbers by `KEYS`, ``flags`` with why a cell is flagged, ``parts``, ``coefficients``,
        ``sentence``), ``failed`` (mission and line) and ``vehicles`` (see `pipeline.report.fleet`).
    """
    done = [summary for summary in summaries if "error" not in summary]
    failed = [{"mission": row["mission"], "error": row["error"]} for row in summaries if "error" in row]
    return {"missions": [_row(summary) for summary in done], "failed": failed, "vehicles": fleet(done)}


def frame(content: Mapping[str, Any]) -> tuple[pd.DataFrame, tuple[Column, ...]]:
    """Return the table of missions, one row each, with its columns."""
    import pandas as pd

    columns = tuple(column for key in KEYS for column in (key.column, key.std) if column is not None)
    rows = [{column.name: row[column.name] for column in columns} for row in content["missions"]]
    return conform(pd.DataFrame(rows, columns=[column.name for column in columns]), columns), columns


def tsv(content: Mapping[str, Any]) -> str:
    """Return the table of missions as text, tabs between the columns, units in the header, nothing where unknown."""
    table, columns = frame(content)
    heads = [f"{column.name} [{column.unit}]" if column.unit else column.name for column in columns]
    return str(table.to_csv(sep="\t", index=False, header=heads, lineterminator="\n", float_format="%.6g"))


def _row(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the key numbers of one mission."""
    parts = [part for part in summary["parts"] if math.isfinite(_number(part["measured_speed_m_s"]))]
    lead: Mapping[str, Any] = max(parts, key=strength, default={})
    coefficients = _coefficients(summary)
    known: Mapping[tuple[str, str], Mapping[str, Any]] = {(item["name"], item["unit"]): item for item in coefficients}
    drag, ballast = known.get(("parasite_drag", "%"), {}), known.get(("net_buoyancy", "N"), {})
    row = {
        "mission": summary["mission"],
        "vehicle": summary["vehicle"]["name"],
        "start": summary["data"]["start"][:10],
        "duration_h": summary["data"]["duration_h"],
        "dives": summary["data"]["dives"],
        "blocks": summary["blocks"]["used"],
        "observable_percent": summary["observability"]["observable_percent"],
        "measured_m_s": _number(lead.get("measured_speed_m_s")),
        "measured_m_s_std": _number(lead.get("measured_speed_std_m_s")),
        "theory_m_s": _number(lead.get("as_flown_speed_m_s")),
        "error_cm_s": 100.0 * _number(lead.get("error_m_s")),
        "error_cm_s_std": 100.0 * _number(lead.get("u_val_m_s")),
        "significance": _number(lead.get("significance")),
        **_of(drag, "drag_percent", ""),
        **_of(drag, "force_drag_percent", "force_"),
        **_of(ballast, "ballast_N", ""),
        **_of(ballast, "force_ballast_N", "force_"),
        "warnings": sum(row.get("severity") in ("error", "warning") for row in summary["findings"]),
    }
    return row | {
        "part": lead.get("name", ""),
        "sentence": summary["answer"]["sentence"],
        "flags": _flags(row, drag, summary),
        "parts": [_part(part) for part in summary["parts"]],
        "coefficients": coefficients,
    }


def _of(item: Mapping[str, Any], name: str, prefix: str) -> dict[str, float]:
    return {name: _number(item.get(f"{prefix}value")), f"{name}_std": _number(item.get(f"{prefix}std"))}


def _coefficients(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what blocks and force estimate say of each coefficient, one row a coefficient and unit."""
    adjusted = {item["name"]: item for item in summary["force"]["parameters"]}
    fitted = {item["name"]: item for item in summary["fit"]["parameters"]}
    out = []
    for name in dict.fromkeys([*fitted, *(ours for ours, theirs in ADJUSTED.items() if theirs in adjusted)]):
        item, force = fitted.get(name), adjusted.get(ADJUSTED.get(name, ""))
        own = None if item is None else _in_unit(item)
        known = item is not None and told(_number(item["std"]), _number(item["prior_std"]))
        symbol = SYMBOLS.get(name, "") if item is None else item["symbol"]
        for unit in dict.fromkeys([*([own[2]] if own else []), *([force["unit"]] if force else [])]):
            value, std = own[:2] if known and own and own[2] == unit else (math.nan, math.nan)
            beside = force if force and force["unit"] == unit else {}
            out.append(
                {
                    "name": name,
                    "symbol": symbol,
                    "unit": unit,
                    "value": value,
                    "std": std,
                    "force_value": _number(beside.get("value")),
                    "force_std": _number(beside.get("std")),
                    "verdict": item["verdict"] if item and own and own[2] == unit else "",
                }
            )
    return out


def _in_unit(item: Mapping[str, Any]) -> tuple[float, float, str]:
    """Return a correction with its 1-sigma and unit, a percentage where there is something that it is a share of."""
    if math.isfinite(_number(item["percent"])):
        return _number(item["percent"]), _number(item["percent_std"]), "%"
    factor, unit = (100.0, "%") if item["name"] == "thrust_scale" else (1.0, item["unit"])
    return factor * _number(item["value"]), factor * _number(item["std"]), unit


def _part(part: Mapping[str, Any]) -> dict[str, Any]:
    """Return the gap between theory and measurement in one part of a mission."""
    return {
        "name": part["name"],
        "powered": part["powered"],
        "pitch_deg": _number(part["pitch_deg"]),
        "error_cm_s": 100.0 * _number(part["error_m_s"]),
        "u_val_cm_s": 100.0 * _number(part["u_val_m_s"]),
        "significance": _number(part["significance"]),
        "label": part.get("label", ""),
        "reason": part["measured_reason"] or part["held_reason"],
    }


def _flags(row: Mapping[str, Any], drag: Mapping[str, Any], summary: Mapping[str, Any]) -> dict[str, str]:
    """Return which cells want attention, and why."""
    grave = sum(found.get("severity") == "error" for found in summary["findings"])
    checks = {
        "blocks": (not row["blocks"], "no steady block is used"),
        "observable_percent": (
            row["observable_percent"] < OBSERVABLE,
            f"the speed is determined in less than {OBSERVABLE:.0f} % of the samples",
        ),
        "measured_m_s": (not math.isfinite(row["measured_m_s"]), "no speed was measured"),
        "significance": (row["significance"] > SIGNIFICANT, "theory and measurement differ significantly"),
        "drag_percent": (
            str(drag.get("verdict", "")).endswith("against the prior"),
            "the drag contradicts the vehicle file",
        ),
        "warnings": (grave > 0, f"{grave} of the findings {'is an error' if grave == 1 else 'are errors'}"),
    }
    return {name: why for name, (wrong, why) in checks.items() if wrong}


def _number(value: Any) -> float:
    """Return a number, NaN where there is none."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else math.nan
