"""What the estimators take from the records: plain arrays, and which samples are steady, powered, at the surface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import gsw
import numpy as np
import pandas as pd
from scipy.ndimage import uniform_filter1d

from pipeline.estimate.gyro import turns
from pipeline.estimate.spikes import leaps, noise
from pipeline.geodesy import apart
from pipeline.records import TURNING, Phase, seconds, usable

#: A pause in the records longer than this (s) may hide a manoeuvre.
PAUSE = 120.0
#: Powered flight with less pitch than this (rad) is level flight.
LEVEL = np.radians(10.0)
#: Margins (s) before and after a change within which flight is not steady: some time constants m/(2 K_D V).
BEFORE, AFTER, AFTER_POWERED = 15.0, 45.0, 25.0
#: With its pressure sensor above this depth (m) a vehicle of some 2 m is breaking the surface.
AFLOAT = 1.0
#: A slow turn shows over this time (s), where it is more than this many 1-sigma of what noise makes of it.
SWING, SURE = 30.0, 3.0
#: Pitch turning (rad/s), or the engine at work (share of its stroke per s, m3/s), faster than this is a manoeuvre.
TURNED, PUMPED, LEAKED = np.radians(0.3), 2e-3, 3e-7
#: Farther than this many sampling intervals from a sample of pitch there is a gap.
GAP = 2.5
#: Sinking nose up or rising nose down faster than this (m/s, times sin θ) is not flight.
BACKWARDS = 0.02
#: A gap in pitch longer than this (s), with pitch this far apart (rad) at its ends, hides a turn.
BLIND, UNSEEN = 15.0, np.radians(5.0)
#: Where depth says that pitch turned and came back between two samples, it was this far (rad, 1-sigma) from them.
ASTRAY = np.radians(35.0)
#: Depth stands still where it keeps within this (m) and this many times its noise, for so long (s), by so many samples.
STILL, NOISES, LASTING, SAMPLES = 0.3, 5.0, 180.0, 6
#: Settings reported more often than this (s) are reported whether they change or not.
REGULAR = 60.0
#: V comes to be anything in no less than this (s).
QUICKEST = 25.0


@dataclass(frozen=True)
class Series:
    """Arrays of shape (m,), one value per record; NaN where an instrument did not report."""

    start: float  # s since 1970-01-01 UTC of the first record
    time: np.ndarray  # s since then
    depth: np.ndarray  # m, measured
    pitch: np.ndarray  # rad, measured
    turn: np.ndarray  # rad, by which pitch turns up to the next record, by a gyro
    speed: np.ndarray  # m/s, by a sensor
    speed_std: np.ndarray
    east: np.ndarray  # m from the first fix
    north: np.ndarray
    heading: np.ndarray  # rad, interpolated: an input, not a measurement; NaN if there is none
    pitch_guess: np.ndarray  # rad, interpolated: where the model is first linearised
    depth_rate_guess: np.ndarray  # m/s
    stratification: np.ndarray  # kg/m3/s, |rate of potential density| met; NaN where density is not known
    powered: np.ndarray  # bool
    manoeuvre: np.ndarray  # bool: pitch, engine or propeller changing, or unknown
    turning: np.ndarray  # rad/s, |rate of pitch|
    loose: np.ndarray  # 1/s, one over how long nothing bounds V: engine at work or not logged, propeller switched, …
    gentle: np.ndarray  # bool: powered, and the propeller's setting has not just changed
    surfaced: np.ndarray  # bool
    standing: np.ndarray  # bool: depth stands still without a propeller, on the bottom, held or hovering
    afloat: np.ndarray  # bool: at the surface, or breaking it
    unmeasured: np.ndarray  # bool: no depth or no pitch within `PAUSE`
    cruising: np.ndarray  # bool: powered level flight, steady
    new_setting: np.ndarray  # bool: the propeller's setting differs from that of the last cruise
    swinging: np.ndarray  # rad2/s, random walk of θ that a slow turn amounts to, beyond what noise looks like
    hiding: np.ndarray  # rad2/s, random walk of θ that a turn hidden between two samples amounts to
    leaping: np.ndarray  # bool: depth leaps from here to its next record, farther than a vehicle can move

    def __getitem__(self, part: slice) -> Series:
        parts = {name: value[part] for name, value in vars(self).items() if name != "start"}
        return Series(start=self.start, **parts)

    @property
    def resting(self) -> np.ndarray:
        """Where neither flight nor water moves the vehicle up and down: afloat, or standing; bool of shape (m,)."""
        return np.asarray(self.surfaced | self.standing)

    @property
    def heading_known(self) -> bool:
        """Whether there is a heading, without which displacement says nothing of speed."""
        return bool(np.isfinite(self.heading).any())

    @property
    def located(self) -> bool:
        """Whether two fixes and a heading allow for displacement over ground."""
        return bool(np.isfinite(self.east).sum() >= 2) and self.heading_known


def held(time: np.ndarray, reported: np.ndarray) -> np.ndarray:
    """Return a setting between its reports, shape (m,): NaN before the first.

    Where reports come regularly it has changed in the middle between two, as far as anyone knows; else it was reported
    when it changed.

    Parameters
    ----------
    time
        s, increasing, shape (m,).
    reported
        The setting, NaN where it is not reported, shape (m,).
    """
    known, begins, _ = _reports(time, reported)
    if not known.size:
        return np.full(time.size, np.nan)
    last = np.searchsorted(begins, time, side="right") - 1
    return np.where(last < 0, np.nan, reported[known[np.maximum(last, 0)]])


def changed_within(time: np.ndarray, reported: np.ndarray) -> np.ndarray:
    """Return the time, s, within which a setting changed, at the last record before, and 0 elsewhere, shape (m,).

    Parameters
    ----------
    time, reported
        As for `held`.
    """
    within = np.zeros(time.size)
    known, begins, open_ = _reports(time, reported)
    new = np.flatnonzero(np.diff(reported[known]) != 0.0) + 1
    within[np.maximum(np.searchsorted(time, begins[new]) - 1, 0)] = open_[new]
    return within


def _reports(time: np.ndarray, reported: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the records with a report, when each setting began, and the time, s, within which it did, each (n,)."""
    known = np.flatnonzero(np.isfinite(reported))
    begins, open_ = time[known], np.zeros(known.size)
    gap = np.diff(begins)
    if gap.size and np.median(gap) < REGULAR:
        open_[1:] = np.where(gap < GAP * np.median(gap), gap, 0.0)
    return known, begins - 0.5 * open_, open_


def powered(records: pd.DataFrame) -> np.ndarray:
    """Return where the propeller drives the vehicle, boolean of shape (m,), by its setting as `held`."""
    time = increasing(seconds(records["time"]))
    speed, power = (held(time, records[name].to_numpy()) for name in TURNING)
    with np.errstate(invalid="ignore"):
        turning, drawing = speed > TURNING["propeller_speed"], power > TURNING["propeller_power"]
    return np.asarray(turning | (~np.isfinite(speed) & drawing))


def from_records(records: pd.DataFrame) -> Series:
    """Return the arrays the estimators work on, from the canonical records."""
    time = increasing(seconds(records["time"]))
    start = float(time[0])
    time = time - start
    depth = np.where(usable(records, "pressure"), records["depth"].to_numpy(), np.nan)
    pitch = np.where(usable(records, "pitch"), records["pitch"].to_numpy(), np.nan)
    speed = np.where(usable(records, "speed_through_water"), records["speed_through_water"].to_numpy(), np.nan)
    speed_std = records["speed_through_water_std"].fillna(0.02).to_numpy()
    east, north = _local(records)
    pitch_guess = _interpolate(time, pitch)
    depth_guess = _interpolate(time, depth)
    rate = _rate(time, depth_guess, 20.0)
    phase = records["phase"].to_numpy()
    driven = powered(records)
    surfaced = phase == Phase.SURFACING
    standing = _standing(time, depth) & ~driven & ~surfaced & (depth_guess > AFLOAT)
    leaping = leaps(time, depth)
    turning, pumping = np.abs(_rate(time, pitch_guess, 12.0)), _pumping(time, records)
    logged = bool(np.isfinite(records["buoyancy_volume"]).any())
    switched = near(time, np.diff(driven, prepend=driven[:1]), AFTER, AFTER)
    backwards = rate * np.sin(pitch_guess) > BACKWARDS
    unseen, hiding = _unseen(time, pitch, backwards)
    hidden = backwards | (np.diff(time, append=time[-1]) > PAUSE) | unseen
    manoeuvre = _manoeuvre(time, (turning > TURNED) | pumping | hidden, phase, driven)
    manoeuvre |= near(time, leaping, BEFORE, AFTER) | near(time, standing, BEFORE, AFTER)
    free = pumping | (not logged) | switched | near(time, hidden, BEFORE, AFTER)
    free |= near(time, surfaced | standing, AFTER, AFTER)
    gentle = driven & ~switched
    cruising = driven & ~manoeuvre & ~surfaced & (np.abs(pitch_guess) < LEVEL)
    return Series(
        start=start,
        time=time,
        depth=depth,
        pitch=pitch,
        turn=turns(time, np.where(usable(records, "pitch_rate"), records["pitch_rate"].to_numpy(), np.nan)),
        speed=speed,
        speed_std=speed_std,
        east=east,
        north=north,
        heading=_heading(time, records),
        pitch_guess=pitch_guess,
        depth_rate_guess=rate,
        stratification=_stratification(time, records),
        powered=driven,
        manoeuvre=manoeuvre,
        turning=turning,
        loose=_loose(time, free & manoeuvre & ~(surfaced | standing)),
        gentle=gentle,
        surfaced=surfaced,
        standing=standing,
        afloat=surfaced | (depth_guess < AFLOAT),
        unmeasured=~(near(time, np.isfinite(depth), PAUSE, PAUSE) & near(time, np.isfinite(pitch), PAUSE, PAUSE)),
        cruising=cruising,
        new_setting=_new_setting(cruising, records),
        swinging=_swinging(time, pitch, pitch_guess),
        hiding=hiding,
        leaping=leaping,
    )


def _standing(time: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return where depth keeps still for `LASTING` s, boolean of shape (m,)."""
    known = np.flatnonzero(np.isfinite(depth))
    if known.size < SAMPLES:
        return np.zeros(time.size, dtype=bool)
    clock = pd.to_timedelta(time[known], unit="s")
    around = pd.Series(depth[known], index=clock).rolling(f"{LASTING}s", center=True, min_periods=SAMPLES)
    still = (around.max() - around.min()).to_numpy() < STILL + NOISES * noise(depth[known])
    lasting = time[known] - time[known[0]] >= 0.5 * LASTING  # the window is whole
    lasting &= time[known[-1]] - time[known] >= 0.5 * LASTING
    at = np.zeros(time.size, dtype=bool)
    at[known[still & lasting]] = True
    return near(time, at, 0.5 * LASTING, 0.5 * LASTING)


def increasing(time: np.ndarray) -> np.ndarray:
    """Return `time`, s, shape (m,), strictly increasing: what stands or runs back follows by a millisecond."""
    if not (np.diff(time) <= 0.0).any():
        return time
    step = 1e-3 * np.arange(time.size)
    return np.asarray(np.maximum.accumulate(time - step) + step)


def _interpolate(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    known = np.isfinite(value)
    if not known.any():
        return np.zeros_like(time)
    return np.asarray(np.interp(time, time[known], value[known]))


def _rate(time: np.ndarray, value: np.ndarray, window: float) -> np.ndarray:
    """Return the rate of change of `value` over `window` seconds, on a grid that bears any sampling."""
    if time.size < 3 or time[-1] <= 0:
        return np.zeros_like(time)
    step = max(1.0, time[-1] / 5e6)
    grid = np.arange(0.0, time[-1] + step, step)
    smooth = uniform_filter1d(np.interp(grid, time, value), max(int(window / step), 1), mode="nearest")
    return np.asarray(np.interp(time, grid, np.gradient(smooth, step)))


def _swinging(time: np.ndarray, pitch: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Return the intensity of a random walk, rad²/s, shape (m,), that steps as far as θ turns from sample to sample.

    It is zero where a gap in the samples hides how θ turned.
    """
    known = np.isfinite(pitch)
    if known.sum() < 2:
        return np.zeros(time.size)
    spacing = float(np.median(np.diff(time[known])))
    least = SURE * math.sqrt(2.0) * noise(pitch[known]) / SWING
    turning = np.maximum(_rate(time, guess, SWING) ** 2 - least**2, 0.0) * spacing
    sampled = near(time, known, GAP * spacing, GAP * spacing)
    return np.asarray(np.where(near(time, ~sampled, 0.5 * SWING, 0.5 * SWING), 0.0, turning))


def _pumping(time: np.ndarray, records: pd.DataFrame) -> np.ndarray:
    """Return where the buoyancy engine is at work, boolean of shape (m,)."""
    volume = records["buoyancy_volume"].to_numpy()
    if np.isfinite(volume).sum() <= 2:
        return np.zeros(time.size, dtype=bool)
    stroke = np.nanmax(volume) - np.nanmin(volume)
    return np.asarray(np.abs(_rate(time, _interpolate(time, volume), 8.0)) > max(PUMPED * stroke, LEAKED))


def _unseen(time: np.ndarray, pitch: np.ndarray, backwards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where pitch is not measured and turned meanwhile, and the random walk that this amounts to, (m,) each.

    Half-way between two samples the walk, boolean and rad²/s, leaves open half of what pitch turned from one to the
    other, and `ASTRAY` where the vehicle would have flown backwards with the pitch between them.
    """
    known = np.flatnonzero(np.isfinite(pitch))
    hidden, walk = np.zeros(time.size, dtype=bool), np.zeros(time.size)
    if known.size < 2:
        return hidden, walk
    gap, turn = np.diff(time[known]), np.abs(np.diff(pitch[known]))
    against = np.diff(np.concatenate([[0], np.cumsum(backwards)])[known]) > 0
    long = gap > max(BLIND, GAP * float(np.median(gap)))
    for k in np.flatnonzero((gap > BLIND) & ((turn > UNSEEN) | against)):
        between = slice(known[k], known[k + 1])
        hidden[between] = long[k] or against[k]
        walk[between] = max(turn[k], 2.0 * ASTRAY if against[k] else 0.0) ** 2 / gap[k]
    return hidden, walk


def _loose(time: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return one over the length of each stretch that is `free`, 1/s, at least `QUICKEST`, and 0 elsewhere, (m,)."""
    rate = np.zeros(time.size)
    ends = np.flatnonzero(np.diff(free, prepend=False, append=False))
    for start, end in ends.reshape(-1, 2):
        rate[start:end] = 1.0 / max(float(time[min(end, time.size - 1)] - time[start]), QUICKEST)
    return rate


def _manoeuvre(time: np.ndarray, changing: np.ndarray, phase: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """Return where the vehicle is not in steady flight, with a margin of some time constants on either side."""
    changing = changing | np.diff(driven, prepend=driven[:1])
    changing |= np.isin(phase, (Phase.INFLEXION, Phase.TRANSITION, Phase.UNKNOWN, Phase.SURFACING))
    powered_margin, margin = near(time, changing, BEFORE, AFTER_POWERED), near(time, changing, BEFORE, AFTER)
    return np.asarray(np.where(driven, powered_margin, margin))


def near(time: np.ndarray, event: np.ndarray, before: float, after: float) -> np.ndarray:
    """Return where an event is at most `before` seconds ahead or `after` seconds past, shape (m,)."""
    events = np.flatnonzero(event)
    if not events.size:
        return np.zeros(time.size, dtype=bool)
    index = np.arange(time.size)
    last = events[np.maximum(np.searchsorted(events, index, side="right") - 1, 0)]
    following = events[np.minimum(np.searchsorted(events, index), events.size - 1)]
    since, until = time - time[last], time[following] - time
    return np.asarray(((since >= 0.0) & (since < after)) | ((until >= 0.0) & (until < before)))


def _new_setting(cruising: np.ndarray, records: pd.DataFrame) -> np.ndarray:
    """Return the instants at which a cruise begins with another propeller setting than the one before."""
    setting = records["propeller_speed"].fillna(records["propeller_power"]).ffill().to_numpy()
    starts = np.flatnonzero(cruising & ~np.roll(cruising, 1))
    new = np.zeros(cruising.size, dtype=bool)
    for before, start in pairwise(starts):
        if abs(setting[start] - setting[before]) > 0.02 * abs(setting[before]):
            new[max(int(start) - 1, 0)] = True
    return new


def potential_density(records: pd.DataFrame) -> np.ndarray:
    """Return the potential density at the surface less 1000 kg/m3, shape (m,); NaN where it was not measured."""
    salinity, temperature = (records[name].to_numpy() for name in ("absolute_salinity", "conservative_temperature"))
    known = np.isfinite(salinity) & np.isfinite(temperature)
    density = np.full(len(records), np.nan)
    density[known] = gsw.sigma0(salinity[known], temperature[known])
    return density


def _stratification(time: np.ndarray, records: pd.DataFrame) -> np.ndarray:
    """Return how fast the vehicle meets water of another potential density, smoothed over 30 s."""
    density = potential_density(records)
    if np.isfinite(density).sum() < 3:
        return np.full(time.size, np.nan)
    return np.asarray(np.abs(_rate(time, _interpolate(time, density), 30.0)))


def _heading(time: np.ndarray, records: pd.DataFrame) -> np.ndarray:
    known = usable(records, "heading")
    if known.sum() < 2:
        return np.full(time.size, np.nan)
    unwrapped = np.unwrap(records["heading"].to_numpy()[known])
    return np.asarray(np.interp(time, time[known], unwrapped))


def _local(records: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return fixes as metres east and north of the first one."""
    known = usable(records, "latitude") & usable(records, "longitude")
    latitude = np.where(known, records["latitude"].to_numpy(), np.nan)
    longitude = np.where(known, records["longitude"].to_numpy(), np.nan)
    if not known.any():
        return latitude, longitude
    first = int(np.flatnonzero(known)[0])
    return apart(latitude, longitude, latitude[first], longitude[first])
