"""Data compatibility: do depth, pitch and speed tell of one flight? Looked at before anything is estimated.

Flight-path reconstruction (Klein and Schiess 1977, NASA TN D-8514; Mulder et al. 1999,
doi:10.1016/S0376-0421(99)00005-6), as far as a glider's few instruments carry it: spikes, the offset between the clocks
of pressure and pitch, the offset of the pressure sensor, bias and scale of the pitch. Each quantity is reported with
its 1-sigma, or with the reason why the data do not determine it. A correction is applied only when it is significant,
`SIGNIFICANT` standard deviations: with half a dozen quantities a mission, two would invent a fault in one mission of
four, three in one of sixty. A speed sensor that is held out as a check is not looked at.

A clock is never shifted here. The estimates have a row for each record, and records are merged on the clocks as ingest
sees them; so what is found is reported with the line of mission.yaml (`clock_offset`) that makes ingest do it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gsw
import numpy as np
import pandas as pd

from pipeline.estimate.attitude import SCALE, attitude
from pipeline.estimate.lag import lag
from pipeline.estimate.sensors import Scale
from pipeline.estimate.series import Series, from_records
from pipeline.estimate.spikes import FASTEST, SPAN, depth_spikes, pitch_spikes, speed_spikes
from pipeline.findings import Finding
from pipeline.geodesy import typical_latitude
from pipeline.mission import Mission
from pipeline.records import Quality, usable
from pipeline.vehicle import Vehicle

#: A quantity is significant beyond this many standard deviations.
SIGNIFICANT = 3.0
#: The data are said to determine the scale of a speed sensor when its 1-sigma falls below this share of what it was.
DETERMINED = 0.5
#: Closer to the surface than this (m) pitch and speed go where waves and antenna want them.
WAVES = 5.0
#: Spikes that are listed one by one, of each instrument.
LISTED = 10
#: Pressure (dbar) at the sensor of a vehicle afloat, and 1-sigma of what waves and its place in the hull leave open:
#: lying flat, and what is added when it stands on its nose with the antenna out.
AFLOAT, STANDING = (0.25, 0.3), (0.9, 0.5)
#: A fix vouches for the surface this long, s; readings farther apart than `APART` s are two surfacings.
FIX, APART = 15.0, 300.0
#: Pitch and pressure that share more of their records than this have one clock.
SHARED = 0.9

Entry = dict[str, Any]
_COLUMNS = {"depth": "pressure", "pitch": "pitch", "speed": "speed_through_water"}
_UNITS = {"depth": "m", "pitch": "rad", "speed": "m/s"}


@dataclass(frozen=True)
class Compatibility:
    """What was found, and the series with what was applied.

    Attributes
    ----------
    series
        The corrected series: spikes NaN, significant corrections of pitch and depth applied; the one given if nothing
        was applied.
    report
        ``pitch_bias``, ``pitch_scale``, ``pressure_offset``, ``pressure_lag``, ``outliers``, each with ``value``,
        ``std``, ``unit``, ``nominal`` (its value when nothing is wrong), ``significant``, ``applied``, ``reason``;
        ``value`` is None where the data do not determine it. ``outliers`` has also ``instruments``: count and first
        values of each.
    findings
        What a person should know, or do.
    """

    series: Series
    report: dict[str, Entry]
    findings: list[Finding]


def reconcile(records: pd.DataFrame, series: Series, vehicle: Vehicle, mission: Mission) -> Compatibility:
    """Return `series` made compatible with itself, and a report on what was wrong.

    Parameters
    ----------
    records
        Canonical records, one row per instant.
    series
        What `series.from_records` makes of them, m instants; none is enough.
    vehicle
        Its polar (ratios of coefficients) is used if, and only if, a speed sensor is.
    mission
        `speed_sensor: use` says that the sensor may be fitted to.

    Returns
    -------
    Compatibility
        Never an exception for what the data are like.
    """
    report: dict[str, Entry] = {}
    findings: list[Finding] = []
    spikes = _spikes(series, use_speed=mission.speed_sensor == "use")
    report["outliers"] = _listed(series, spikes, findings)
    flags = {}
    for name, mask in spikes.items():
        if mask.any():
            column = f"{_COLUMNS[name]}_qc"
            flags[column] = np.where(mask, np.int8(Quality.BAD), records[column].to_numpy())
    if flags:
        records = records.assign(**flags)
        series = from_records(records)
    _leaps(series, findings)
    report["pressure_lag"] = quantity(
        "s", reason="with one pressure sensor a lag cannot be told from the offset between the clocks: see clock_offset"
    )
    report["pressure_offset"], shift = _pressure_offset(
        records, series, typical_latitude(records["latitude"], mission.latitude), findings
    )
    report["pitch_bias"], report["pitch_scale"], line = _attitude(series, vehicle, mission, findings)
    changes: dict[str, Any] = {}
    if shift != 0.0:
        changes["depth"] = records["depth"] - shift
    if line != (0.0, 1.0):
        changes["pitch"] = line[1] * records["pitch"] + line[0]
    if changes:
        series = from_records(records.assign(**changes))
    return Compatibility(series, report, findings)


def speed_scale(found: Scale | None, before: float) -> Entry:
    """Return the report on the scale error of a speed sensor that is used; `before` is its 1-sigma before the mission.

    It is found with the estimate, not before it, and always applied. It has also ``determined``: whether the data, not
    what was known before, say what it is.
    """
    if found is None:
        return quantity("1", reason="the speed sensor reported nothing") | {"determined": False}
    entry = quantity("1", found.value, found.std)
    determined = found.std < DETERMINED * before
    told = f"1-sigma {100.0 * before:.2g} % before the mission, {100.0 * found.std:.2g} % now"
    reason = told if determined else f"not determined by these data: {told}"
    return entry | {"applied": True, "reason": reason, "determined": determined}


def quantity(
    unit: str, value: float | None = None, std: float | None = None, *, nominal: float = 0.0, reason: str = ""
) -> Entry:
    """Return the report on one quantity, not applied; `nominal` is its value when nothing is wrong."""
    if value is None or std is None or not (math.isfinite(value) and math.isfinite(std)):
        value = std = None
    significant = value is not None and std is not None and abs(value - nominal) > SIGNIFICANT * std
    return {
        "value": value,
        "std": std,
        "unit": unit,
        "nominal": nominal,
        "significant": significant,
        "applied": False,
        "reason": reason if reason or significant else f"within {SIGNIFICANT:g} standard deviations of none",
    }


def _spikes(series: Series, *, use_speed: bool) -> dict[str, np.ndarray]:
    """Return where depth, pitch and a used speed are spikes, boolean arrays of shape (m,)."""
    time = series.time
    known = {name: np.isfinite(getattr(series, name)) for name in ("depth", "pitch")}
    out = {name: np.zeros(time.size, dtype=bool) for name in _COLUMNS}
    out["depth"][known["depth"]] = depth_spikes(time[known["depth"]], series.depth[known["depth"]])
    out["pitch"][known["pitch"]] = pitch_spikes(time[known["pitch"]], series.pitch[known["pitch"]])
    depth = known["depth"] & ~out["depth"]
    if not depth.any():
        return out
    deep = np.interp(time, time[depth], series.depth[depth]) > WAVES
    out["pitch"] &= deep
    pitch = known["pitch"] & ~out["pitch"]
    at = np.isfinite(series.speed) & use_speed
    if at.any() and pitch.any():
        t = time[at]
        ahead, behind = (np.interp(t + off, time[depth], series.depth[depth]) for off in (0.5 * SPAN, -0.5 * SPAN))
        out["speed"][at] = speed_spikes(
            t,
            series.speed[at],
            np.nan_to_num(series.speed_std[at], nan=0.02),
            (ahead - behind) / SPAN,
            np.interp(t, time[pitch], series.pitch[pitch]),
            (series.manoeuvre | series.resting)[at],
        )
        out["speed"] &= deep
    return out


def _listed(series: Series, spikes: dict[str, np.ndarray], findings: list[Finding]) -> Entry:
    """Return the report on spikes, and add a finding for each instrument that has some."""
    instruments: dict[str, Any] = {}
    for name, mask in spikes.items():
        rows = np.flatnonzero(mask)
        value = getattr(series, name)
        instruments[name] = {
            "count": int(rows.size),
            "first": [{"time_s": float(series.time[k]), "value": float(value[k])} for k in rows[:LISTED]],
        }
        if rows.size:
            first = f"{value[rows[0]]:.4g} {_UNITS[name]}"
            findings.append(
                Finding(
                    "warning",
                    f"{name} record",
                    f"{float(series.time[rows[0]]):.0f} s in",
                    f"{rows.size} outlier{'s' if rows.size > 1 else ''} of {int(np.isfinite(value).sum())}, "
                    f"the first {first}",
                    "what the vehicle can do between two samples",
                    "left out of the estimate",
                )
            )
    count = sum(item["count"] for item in instruments.values())
    return {
        "value": count,
        "std": None,
        "unit": "1",
        "nominal": 0.0,
        "significant": count > 0,
        "applied": count > 0,
        "reason": "measurements that go out and come back at once, or cannot be" if count else "none found",
        "instruments": instruments,
    }


def _leaps(series: Series, findings: list[Finding]) -> None:
    """Add a finding on steps of depth that are none of a vehicle."""
    at = np.flatnonzero(series.leaping)
    if at.size:
        known = np.flatnonzero(np.isfinite(series.depth))
        following = known[np.searchsorted(known, at[0], side="right")]
        findings.append(
            Finding(
                "warning",
                "depth record",
                f"{float(series.time[at[0]]):.0f} s in",
                f"depth leaps from {series.depth[at[0]]:.0f} to {series.depth[following]:.0f} m within "
                f"{series.time[following] - series.time[at[0]]:.0f} s{f', the first of {at.size}' * (at.size > 1)}",
                f"what a vehicle can do, at most {FASTEST:g} m/s",
                "nothing is carried across; is a part of the log missing, or a clock wrong?",
            )
        )


def clock_offset(stretches: Sequence[Series], mission: Mission) -> tuple[Entry, list[Finding]]:
    """Return the report on the seconds to add to the clock of pressure, with a finding if they are significant.

    Parameters
    ----------
    stretches
        Parts of a mission as `reconcile` leaves them, in order, one at least.
    mission
        `clock_offset` that ingest has added.
    """
    findings: list[Finding] = []
    first = stretches[0].start
    time = np.concatenate([series.time + (series.start - first) for series in stretches])
    value, angle, driven = (
        np.concatenate([getattr(series, name) for series in stretches]) for name in ("depth", "pitch", "powered")
    )
    depth, pitch = np.isfinite(value), np.isfinite(angle)
    found = lag(time[depth], value[depth], driven[depth], time[pitch], angle[pitch])
    entry = quantity("s", found.value, found.std, reason=found.reason)
    entry["windows"] = found.windows
    if pitch.any() and float(np.mean(depth[pitch])) > SHARED:
        shared = "pitch and pressure are in the same records: an offset would be a sensor's delay, not a clock's"
        entry["reason"] = f"{entry['reason']}; {shared}" if entry["reason"] else shared
    if entry["significant"]:
        offset, std = float(entry["value"]), float(entry["std"])
        told = f"{mission.clock_offset + offset:.1f}"
        remedy = f"set clock_offset: {told} in mission.yaml if the clocks are to blame"
        findings.append(
            Finding(
                "warning",
                "pressure record",
                "time",
                f"depth that bends {abs(offset):.1f} ± {std:.1f} s "
                f"{'before' if offset > 0.0 else 'after'} the pitch does",
                "at once",
                remedy,
            )
        )
        why = f"not applied: ingest merges the clocks; {remedy}"
        entry["reason"] = f"{why}; {entry['reason']}" if entry["reason"] else why
    return entry, findings


def _pressure_offset(
    records: pd.DataFrame, series: Series, latitude: float, findings: list[Finding]
) -> tuple[Entry, float]:
    """Return the report on what the pressure sensor reads too much, and the metres to take off the depth."""
    read = usable(records, "pressure")
    time, pressure = series.time[read], records["pressure"].to_numpy(dtype=np.float64)[read]
    fixes = series.time[np.isfinite(series.east)]
    near = np.zeros(time.size, dtype=bool)
    if fixes.size and time.size:
        after = np.searchsorted(fixes, time)
        later, earlier = fixes[np.minimum(after, fixes.size - 1)], fixes[np.maximum(after - 1, 0)]
        near = np.minimum(np.abs(later - time), np.abs(time - earlier)) < FIX
    if not near.any():
        near = series.surfaced[read]
    if near.sum() < 3:
        return quantity("dbar", reason="pressure was not read at the surface"), 0.0
    number = np.cumsum(np.diff(time[near], prepend=-np.inf) > APART)
    each = pd.Series(pressure[near]).groupby(number).median().to_numpy()
    spread = each if each.size > 2 else pressure[near]
    scatter = 1.4826 * float(np.median(np.abs(spread - np.median(spread)))) * math.sqrt(0.5 * math.pi / each.size)
    tilted = series.pitch[np.isfinite(series.pitch) & (series.surfaced | np.isfinite(series.east))]
    tilt = math.sin(abs(float(np.median(tilted)))) if tilted.size else 0.5
    value = float(np.median(each)) - AFLOAT[0] - STANDING[0] * tilt
    std = math.hypot(scatter, AFLOAT[1], STANDING[1] * tilt)
    entry = quantity("dbar", value, std)
    entry["surfacings"] = int(each.size)
    if not entry["significant"]:
        return entry, 0.0
    entry |= {"applied": True, "reason": "taken off the depth"}
    found = f"{value:.2f} ± {std:.2f} dbar too much at {each.size} surfacings"
    findings.append(Finding("warning", "pressure record", "", found, "0 dbar at the surface", "taken off the depth"))
    return entry, -float(gsw.z_from_p(value, latitude))


def _attitude(
    series: Series, vehicle: Vehicle, mission: Mission, findings: list[Finding]
) -> tuple[Entry, Entry, tuple[float, float]]:
    """Return the reports on bias and scale of pitch, and the line (bias, scale) to apply."""
    none = (0.0, 1.0)
    if mission.speed_sensor != "use" or not np.isfinite(series.speed).any():
        reason = "needs a speed sensor that may be used: depth and pitch alone do not tell it from water motion"
        return quantity("rad", reason=reason), quantity("1", reason=reason), none
    if mission.speed_sensor_scale_std > SCALE:
        reason = f"the scale of the speed sensor itself is not known to {100.0 * SCALE:g} %"
        return quantity("rad", reason=reason), quantity("1", reason=reason), none
    fit = attitude(series, vehicle)
    if fit.reason:
        return quantity("rad", reason=fit.reason), quantity("1", reason=fit.reason), none
    C = fit.covariance
    bias = quantity("rad", fit.bias, math.sqrt(C[0, 0]))
    scale = quantity("1", fit.scale, math.sqrt(C[1, 1]), nominal=1.0)
    if not fit.told_apart:
        scale = quantity("1", reason="pitch differs too little between the blocks to tell a scale from a bias")
    line = [fit.bias, fit.scale]
    if not scale["significant"]:
        line = [fit.bias - C[0, 1] / C[1, 1] * (fit.scale - 1.0), 1.0]
    if not bias["significant"]:
        line[0] = 0.0
        if scale["significant"]:
            line[1] = fit.scale - C[0, 1] / C[0, 0] * fit.bias
    for entry, applied in ((bias, line[0]), (scale, line[1])):
        if entry["significant"]:
            entry |= {"value": float(applied), "applied": True, "reason": f"fitted to {fit.blocks} blocks"}
    if bias["applied"] or scale["applied"]:
        offset = line[1] * mission.pitch.offset_rad + line[0]
        findings.append(
            Finding(
                "warning",
                "pitch record",
                "",
                f"a pitch that is {line[1]:.3f} · logged {line[0]:+.4f} rad by the speed sensor",
                "the logged pitch",
                f"applied; to keep it, set pitch: {{scale: {line[1] * mission.pitch.scale:.3f}, "
                f"offset_rad: {offset:.4f}}} in mission.yaml",
            )
        )
    return bias, scale, (float(line[0]), float(line[1]))
