"""Quality: OG1 flags by general rules, one instrument at a time. Values are kept, only flagged.

Ranges, spikes and stuck sensors follow the tests of Argo real-time quality control (Wong et al. 2023, Argo Quality
Control Manual, doi:10.13155/33951), with limits for a glider's clock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding, InputError
from pipeline.records import MEASURED, Quality

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

NAMES = tuple(column.name for column in MEASURED)
_UNITS = {column.name: column.unit for column in MEASURED}

#: What a sensor on a glider can read at all, in the units of the records.
RANGES: dict[str, tuple[float, float]] = {
    "pressure": (-5.0, 11000.0),
    "temperature": (-3.0, 45.0),
    "conductivity": (0.0, 9.0),
    "pitch": (-math.pi / 2, math.pi / 2),
    "pitch_rate": (-1.0, 1.0),
    "roll": (-math.pi, math.pi),
    "heading": (-2 * math.pi, 4 * math.pi),
    "buoyancy_volume": (-0.02, 0.02),
    "battery_position": (-1.0, 1.0),
    "battery_roll": (-2 * math.pi, 2 * math.pi),
    "propeller_speed": (-100.0, 100.0),
    "propeller_power": (-10.0, 2000.0),
    "battery_voltage": (1.0, 500.0),
    "speed_through_water": (-1.0, 5.0),
    "latitude": (-90.0, 90.0),
    "longitude": (-360.0, 360.0),
}

_FASTEST = 3.0  # dbar/s, no glider dives or climbs faster
_SPIKE = (3.0, 30.0)  # dbar, least and greatest departure from the running median that counts as one
_RATE_SPIKE = 0.05  # rad/s
_WINDOW = 7  # samples of the running median
_STUCK_SAMPLES, _STUCK_SECONDS, _STUCK_DBAR = 25, 120.0, 20.0
_SLOWEST = 0.12  # m/s through the water, no glider is slower and steep
_BELOW = 5.0  # dbar, where no glider floats
_OFFSET = 0.5  # dbar at the surface worth a note
_ABSOLUTE = (9.6, 10.8)  # dbar, least pressure of a sensor that feels the atmosphere as well


def checked(streams: list[pd.DataFrame]) -> tuple[list[pd.DataFrame], list[Finding]]:
    """Return `streams` with a flag ``<name>_qc`` beside every measurement, and what the flags say.

    Flags that a reader has set stay where they are worse. The first rule that fails decides: missing, out of range,
    spike, stuck; everything else is good.
    """
    findings: list[Finding] = []
    reference, attitude = _reference(streams, "pressure"), _reference(streams, "pitch")
    out = []
    for frame in streams:
        name = str(frame.attrs.get("name", "stream"))
        flags: dict[str, npt.NDArray[np.int8]] = {}
        measured: dict[str, Array] = {}
        for column in (column for column in NAMES if column in frame):
            values = frame[column].to_numpy(dtype=np.float64)
            time = frame["time"].to_numpy(dtype=np.float64)
            infinite = np.isinf(values)
            if infinite.any():
                findings.append(_infinite(name, column, infinite))
                values = np.where(infinite, np.nan, values)
                measured[column] = values
            missing = ~np.isfinite(values)
            flag = np.where(missing, Quality.MISSING, Quality.GOOD).astype(np.int8)
            if missing.all():
                findings.append(
                    Finding("warning", name, column, f"no number in {len(frame)} records", "measurements", "not used")
                )
            inside = within(values, column)
            if column in ("latitude", "longitude") and {"latitude", "longitude"} <= set(frame.columns):
                inside &= ~((frame["latitude"].to_numpy() == 0.0) & (frame["longitude"].to_numpy() == 0.0))
            bad = {"out of range": ~missing & ~inside}
            usable = ~missing & inside
            if column == "pressure":
                bad["in a spike"] = _at(usable, pressure_spikes(time[usable], values[usable]))
                if attitude is not None:
                    held = held_while_steep(time[usable], values[usable], *attitude)
                    bad["of a stuck sensor"] = _at(usable, held)
            elif column == "temperature":
                bad["in a spike"] = _at(usable, temperature_spikes(values[usable]))
            elif column == "pitch_rate":
                bad["in a spike"] = _at(usable, rate_spikes(values[usable]))
            elif column == "pitch" and reference is not None:
                bad["of a stuck sensor"] = _at(usable, stuck(time[usable], values[usable], *reference))
            for what, mask in bad.items():
                if mask.any():
                    flag[mask] = Quality.BAD
                    findings.append(_flagged(name, column, what, mask, values))
            flags[f"{column}_qc"] = _worse(flag, frame.get(f"{column}_qc"))
        result = frame.assign(**measured, **flags)
        result.attrs = frame.attrs
        out.append(result)
    return out, findings


def within(values: Array, name: str) -> Mask:
    """Return where `values`, shape (n,), lie in what a sensor of `name` can read; False for NaN."""
    low, high = RANGES[name]
    return np.asarray((values >= low) & (values <= high))


def pressure_spikes(time: Array, pressure: Array) -> Mask:
    """Return where `pressure` [dbar], shape (n,), jumps away from its neighbours faster than any glider and back.

    A spike departs from the running median of seven samples by more than 3 dbar/s times the sampling interval, at
    least 3 and at most 30 dbar.
    """
    if pressure.size < 3:
        return np.zeros(pressure.size, dtype=bool)
    from scipy.ndimage import median_filter

    step = np.diff(time)
    apart = np.minimum(np.r_[np.inf, step], np.r_[step, np.inf])
    departure = np.abs(pressure - median_filter(pressure, _WINDOW, mode="nearest"))
    usual = 10.0 * float(np.median(step))
    return np.asarray((departure > np.clip(_FASTEST * apart, *_SPIKE)) & (apart <= max(usual, 60.0)))


def rate_spikes(rate: Array) -> Mask:
    """Return where `rate` of pitch [rad/s], shape (n,), leaves both of its neighbours to one side, and they agree.

    A spike departs from them by more than 0.05 rad/s (3°/s) and eight times the noise, which is the median of the
    third differences; the neighbours differ by less than 0.4 of that.
    """
    spikes = np.zeros(rate.size, dtype=bool)
    if rate.size < 8:
        return spikes
    noise = float(np.median(np.abs(np.diff(rate, 3)))) / (0.6745 * math.sqrt(20.0))
    before, after = rate[1:-1] - rate[:-2], rate[1:-1] - rate[2:]
    least = np.minimum(np.abs(before), np.abs(after))
    spikes[1:-1] = (before * after > 0.0) & (least > max(_RATE_SPIKE, 8.0 * noise))
    spikes[1:-1] &= np.abs(rate[2:] - rate[:-2]) < 0.4 * least
    return spikes


def temperature_spikes(temperature: Array) -> Mask:
    """Return where `temperature` [°C], shape (n,), fails Argo's spike test: |V2 − (V1+V3)/2| − |(V3−V1)/2| > 6 °C."""
    out = np.zeros(temperature.size, dtype=bool)
    if temperature.size > 2:
        before, here, after = temperature[:-2], temperature[1:-1], temperature[2:]
        out[1:-1] = np.abs(here - (before + after) / 2) - np.abs((after - before) / 2) > 6.0
    return out


def stuck(time: Array, values: Array, pressure_time: Array, pressure: Array) -> Mask:
    """Return where `values`, shape (n,), repeat to the last digit while the vehicle moves through the water column.

    At least 25 equal samples over at least 2 minutes, during which pressure changes by 20 dbar or more. A sensor that
    is so more than half of the time is a coarse one, not a stuck one, unless the vehicle turns from diving to climbing
    meanwhile.
    """
    out = np.zeros(values.size, dtype=bool)
    if values.size < _STUCK_SAMPLES or pressure.size < 2:
        return out
    starts = np.r_[0, np.flatnonzero(np.diff(values) != 0) + 1]
    ends = np.r_[starts[1:], values.size]
    long = (ends - starts >= _STUCK_SAMPLES) & (time[ends - 1] - time[starts] >= _STUCK_SECONDS)
    coarse = 2 * int((ends - starts)[long].sum()) > values.size
    for start, end in zip(starts[long], ends[long], strict=True):
        during = pressure[slice(*np.searchsorted(pressure_time, (time[start], time[end - 1])))]
        if during.size < 2 or np.ptp(during) < _STUCK_DBAR:
            continue
        turn = max(during.max() - max(during[0], during[-1]), min(during[0], during[-1]) - during.min())
        out[start:end] = not coarse or turn > 0.5 * _STUCK_DBAR
    return out


def held_while_steep(time: Array, pressure: Array, pitch_time: Array, pitch: Array) -> Mask:
    """Return where `pressure` [dbar], shape (n,), repeats to the last digit while pitch says that depth must change.

    At least 25 equal samples below 5 dbar, where it does not float, over which the slowest glider, 0.12 m/s along its
    nose [rad], would have dived or climbed 20 m in all.
    """
    out = np.zeros(pressure.size, dtype=bool)
    if pressure.size < _STUCK_SAMPLES or pitch.size < 2:
        return out
    starts = np.r_[0, np.flatnonzero(np.diff(pressure) != 0) + 1]
    ends = np.r_[starts[1:], pressure.size]
    long = (ends - starts >= _STUCK_SAMPLES) & (pressure[starts] > _BELOW)
    for start, end in zip(starts[long], ends[long], strict=True):
        during = pitch[slice(*np.searchsorted(pitch_time, (time[start], time[end - 1])))]
        if during.size >= _STUCK_SAMPLES:
            way = _SLOWEST * float(np.mean(np.abs(np.sin(during)))) * (time[end - 1] - time[start])
            out[start:end] = way >= _STUCK_DBAR
    return out


def require(
    streams: list[pd.DataFrame],
    names: tuple[str, ...] = ("pressure", "pitch"),
    *,
    lost: Sequence[Finding] = (),
) -> None:
    """Check that each of `names` is measured somewhere, and mostly in the range of its sensor.

    Parameters
    ----------
    streams
        Flagged frames.
    names
        What is needed.
    lost
        What was found until now: a file or column that was left out is the likeliest reason why one is missing.

    Raises
    ------
    InputError
        If one is missing, is nothing but NaN, or lies out of range more often than not.
    """
    labels = list(dict.fromkeys(str(frame.attrs.get("name", "a stream")) for frame in streams))
    for name in names:
        carriers = [frame for frame in streams if name in frame]
        if not carriers:
            raise InputError(
                "mission",
                found=f"no {name} in {', '.join(labels) or 'any file'}",
                expected=f"a {name} column",
                remedy=_reason(name, lost) or "name it under files: … in mission.yaml",
            )
        counts = [
            (_inside(frame, name), int(np.isfinite(frame[name].to_numpy(dtype=np.float64)).sum())) for frame in carriers
        ]
        if any(2 * inside > reported for inside, reported in counts):
            continue
        frame = carriers[int(np.argmax([reported for _, reported in counts]))]
        column = frame.attrs.get("columns", {}).get(name, name)
        values = frame[name].to_numpy(dtype=np.float64)
        finite = values[np.isfinite(values)]
        if finite.size == 0:
            raise InputError(
                str(frame.attrs.get("name", "mission")),
                f"column '{column}'",
                found=f"no {name} in {len(frame)} records, only NaN",
                expected=f"a {name} sensor that reports",
                remedy="the mission cannot be analysed without it",
            )
        low, high = RANGES[name]
        raise InputError(
            str(frame.attrs.get("name", "mission")),
            f"column '{column}'",
            found=f"{name} from {finite.min():.4g} to {finite.max():.4g} {_UNITS[name]}",
            expected=f"{low:.4g} to {high:.4g} {_UNITS[name]}",
            remedy="correct its unit under files: in mission.yaml",
        )


def _inside(frame: pd.DataFrame, name: str) -> int:
    """Return how many values of `name` lie in the range of its sensor."""
    return int(within(frame[name].to_numpy(dtype=np.float64), name).sum())


def _reason(name: str, lost: Sequence[Finding]) -> str:
    """Return the finding that says best why `name` is missing: its column was left out, or else a file was."""
    about = [finding for finding in lost if finding.severity != "note"]
    columns = [finding for finding in about if name in f"{finding.where} {finding.found}"]
    files = [finding for finding in about if "left out" in finding.remedy or "not read" in finding.remedy]
    return next((str(finding) for finding in [*columns, *files]), "")


def surface_offset(streams: list[pd.DataFrame]) -> list[Finding]:
    """Return a note where pressure is not zero at the surface: at the GPS fixes, else where it is least.

    A least pressure of one atmosphere is worth a warning.
    """
    fixes = [
        frame["time"][frame["latitude_qc"] == Quality.GOOD].to_numpy(dtype=np.float64)
        for frame in streams
        if "latitude_qc" in frame
    ]
    times = np.sort(np.concatenate(fixes)) if fixes else np.zeros(0)
    findings = []
    for frame in streams:
        if "pressure" not in frame:
            continue
        good = (frame["pressure_qc"] == Quality.GOOD).to_numpy()
        time, pressure = frame["time"].to_numpy(np.float64)[good], frame["pressure"].to_numpy(np.float64)[good]
        if not time.size:
            continue
        near = np.zeros(time.size, dtype=bool)
        if times.size:
            after = np.clip(np.searchsorted(times, time), 1, times.size - 1) if times.size > 1 else 0
            near = np.minimum(np.abs(time - times[after]), np.abs(time - times[np.maximum(after - 1, 0)])) < 30.0
        offset, where = float(pressure.min()), "at its least"
        if _ABSOLUTE[0] < offset < _ABSOLUTE[1]:
            findings.append(
                Finding(
                    "warning",
                    str(frame.attrs.get("name", "stream")),
                    "pressure",
                    f"{offset:.2f} dbar {where}",
                    "0 dbar at the surface",
                    "not corrected; if it is absolute pressure, give its unit as dbara (bara, psia) under files: in "
                    "mission.yaml",
                )
            )
            continue
        if near.sum() >= 3 and float(np.percentile(pressure[near], 90)) < 5.0:
            offset, where = float(np.median(pressure[near])), "at the GPS fixes"
        if abs(offset) > _OFFSET and (offset < 0 or where == "at the GPS fixes"):
            findings.append(
                Finding(
                    "note",
                    str(frame.attrs.get("name", "stream")),
                    "pressure",
                    f"{offset:.2f} dbar {where}",
                    "0 dbar at the surface",
                    "not corrected: depth rates do not depend on it",
                )
            )
    return findings


def _reference(streams: list[pd.DataFrame], name: str) -> tuple[Array, Array] | None:
    """Return times and values of the stream with most values of `name`, NaN and values out of range left out."""
    best: tuple[Array, Array] | None = None
    for frame in streams:
        if name in frame:
            values = frame[name].to_numpy(dtype=np.float64)
            inside = within(values, name)
            if best is None or inside.sum() > best[0].size:
                best = frame["time"].to_numpy(dtype=np.float64)[inside], values[inside]
    return best


def _at(where: Mask, found: Mask) -> Mask:
    out = np.zeros(where.size, dtype=bool)
    out[where] = found
    return out


def _worse(flag: npt.NDArray[np.int8], given: pd.Series | None) -> npt.NDArray[np.int8]:
    """Return our own flags, or those of the reader where they are worse (missing stays missing)."""
    if given is None:
        return flag
    theirs = given.to_numpy(dtype=np.int8)
    ranked = (theirs >= Quality.GOOD) & (theirs <= Quality.BAD) & (flag != Quality.MISSING)
    return np.where(ranked, np.maximum(flag, theirs), flag).astype(np.int8)


def _infinite(name: str, column: str, mask: Mask) -> Finding:
    row, count = int(np.argmax(mask)), int(mask.sum())
    found = f"{count} infinite value{'s' if count > 1 else ''}"
    return Finding("warning", name, f"{column}, record {row + 1}", found, "a number", "left out")


def _flagged(name: str, column: str, what: str, mask: Mask, values: Array) -> Finding:
    row, count = int(np.argmax(mask)), int(mask.sum())
    low, high = RANGES[column]
    expected = {
        "out of range": f"{low:.4g} to {high:.4g} {_UNITS[column]}",
        "in a spike": "what a glider can do between two samples",
        "of a stuck sensor": f"changes while {'pitch is steep' if column == 'pressure' else 'depth changes'}",
    }[what]
    remedy = "flagged bad and not used"
    if what == "out of range" and 2 * count > int(np.isfinite(values).sum()):
        suspected = "mS/cm" if column == "conductivity" else "another"
        remedy += f"; is its unit {suspected}? correct it under files: in mission.yaml"
    return Finding(
        "warning",
        name,
        f"{column}, record {row + 1}",
        f"{count} value{'s' if count > 1 else ''} {what}, first {values[row]:.6g} {_UNITS[column]}",
        expected,
        remedy,
    )
