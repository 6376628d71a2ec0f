"""Bias and scale of pitch, by a speed sensor: what pitch must have been for the depth rate to be what it was.

In steady unpowered flight sin γ = −(ż + w_w)/V with V measured, and the polar closure gives the pitch θ of that path.
Against the logged pitch, block by block of steady flight, that is a straight line θ = scale · logged + bias, fitted by
generalised least squares. Raw samples would be a trap, the noise of pitch being most of its variation in steady
flight. The covariance has the vertical velocity of the water (1-sigma 1 cm/s, correlation time 300 s), what the polar
leaves open, an offset and a scale of the speed sensor common to all blocks, and the noise of the block means.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimate.series import PAUSE, Series
from pipeline.model.closure import glide_angles
from pipeline.vehicle import Polar, Vehicle

#: Length of a block, least samples of depth, pitch and speed in one, blocks needed, and used at most.
BLOCK, SAMPLES, BLOCKS, MOST = 300.0, 5, 4, 600
#: Vertical velocity of the water: 1-sigma m/s, correlation time s.
WATER, WATER_TIME = 0.01, 300.0
#: Speed sensor: 1-sigma of its offset, m/s, and of its scale.
OFFSET, SCALE = 0.005, 0.01
#: The scale of pitch before anything is measured: 1 with this 1-sigma. What is left of it when the data say nothing.
PRIOR, UNTOLD = 0.1, 0.07
#: Coefficients whose 1-sigma reaches the angle of attack.
COEFFICIENTS = ("lift_at_zero", "lift_slope", "parasite_drag", "induced_drag")


@dataclass(frozen=True)
class Attitude:
    """Pitch = scale · logged + bias.

    Attributes
    ----------
    bias, scale
        rad and 1.
    covariance
        Of bias and scale, shape (2, 2).
    blocks
        Blocks of steady flight used.
    reason
        Why there is no result; else empty.
    """

    bias: float
    scale: float
    covariance: np.ndarray
    blocks: int
    reason: str = ""

    @property
    def told_apart(self) -> bool:
        """Whether the data, not the prior, determine the scale."""
        return bool(self.covariance[1, 1] < UNTOLD**2)


@dataclass(frozen=True)
class _Blocks:
    """Means over blocks of steady unpowered flight, each of shape (n,)."""

    time: np.ndarray
    pitch: np.ndarray
    pitch_variance: np.ndarray
    speed: np.ndarray
    speed_variance: np.ndarray
    rate: np.ndarray
    rate_variance: np.ndarray

    def __getitem__(self, part: np.ndarray) -> _Blocks:
        return _Blocks(**{name: value[part] for name, value in vars(self).items()})


def attitude(series: Series, vehicle: Vehicle) -> Attitude:
    """Return bias and scale of the pitch of `series`, whose speed sensor is believed.

    Parameters
    ----------
    series
        Measurements and flags; the logged pitch, after any correction that mission.yaml asks for.
    vehicle
        Its polar (ratios of coefficients) gives the angle of attack, their 1-sigma its uncertainty.
    """
    if not all(math.isfinite(value) for value in vehicle.polar):
        return Attitude(0.0, 1.0, np.diag([math.inf, PRIOR**2]), 0, "the vehicle's polar is not known")
    blocks = _blocks(series)
    used, wanted = _wanted(blocks, vehicle.polar)
    blocks, wanted = blocks[used], wanted[used]
    n = wanted.size
    if n < BLOCKS:
        reason = f"{n} blocks of steady unpowered flight with depth, pitch and speed where {BLOCKS} are needed"
        return Attitude(0.0, 1.0, np.diag([math.inf, PRIOR**2]), n, reason)
    whiten = np.linalg.inv(np.linalg.cholesky(_covariance(blocks, vehicle, wanted)))
    design = np.column_stack([np.ones(n), blocks.pitch])
    left, right = whiten @ design, whiten @ (wanted - blocks.pitch)
    information = left.T @ left + np.diag([0.0, PRIOR**-2])
    found = np.linalg.solve(information, left.T @ right)
    rest = right - left @ found
    scatter = max(float(rest @ rest) / max(n - 2, 1), 1.0)  # Birge: blocks that scatter more than they should
    return Attitude(float(found[0]), 1.0 + float(found[1]), scatter * np.linalg.inv(information), n)


def _blocks(series: Series) -> _Blocks:
    """Return the means over pieces of at most `BLOCK` seconds of steady unpowered flight below the surface."""
    steady = ~(series.manoeuvre | series.powered | series.resting | series.unmeasured)
    starts = steady & ~np.concatenate([[False], steady[:-1]])
    starts |= np.diff(series.time, prepend=series.time[:1]) > PAUSE
    run = np.maximum(np.cumsum(starts) - 1, 0)
    begin = series.time[np.flatnonzero(starts)] if starts.any() else series.time[:1]
    piece = np.floor((series.time - begin[np.minimum(run, begin.size - 1)]) / BLOCK).astype(np.int64)
    new = starts | (np.diff(piece, prepend=-1) != 0)
    label = np.cumsum(new)[steady] - 1
    label = np.unique(label, return_inverse=True)[1]
    size = int(label.max(initial=-1)) + 1
    time = series.time[steady]

    def means(value: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return count, mean and variance of the mean of `value` in each piece."""
        known = np.isfinite(value)
        count = np.bincount(label[known], minlength=size).astype(np.float64)
        mean = np.bincount(label[known], value[known], size) / np.maximum(count, 1.0)
        square = np.bincount(label[known], (value[known] - mean[label[known]]) ** 2, size)
        return count, mean, square / np.maximum(count * (count - 1.0), 1.0)

    pitches, pitch, pitch_variance = means(series.pitch[steady])
    speeds, speed, speed_variance = means(series.speed[steady])
    depth = series.depth[steady]
    depths, middle, _ = means(depth)
    _, centre, _ = means(np.where(np.isfinite(depth), time, np.nan))
    since, below = time - centre[label], depth - middle[label]
    known = np.isfinite(depth)
    spread = np.maximum(np.bincount(label[known], since[known] ** 2, size), 1e-9)
    rate = np.bincount(label[known], (since * below)[known], size) / spread
    rest = np.bincount(label[known], (below - rate[label] * since)[known] ** 2, size)
    rate_variance = rest / np.maximum(depths - 2.0, 1.0) / spread
    enough = np.minimum(np.minimum(pitches, speeds), depths) >= SAMPLES
    blocks = _Blocks(centre, pitch, pitch_variance, speed, speed_variance, rate, rate_variance)[enough]
    every = -(-blocks.time.size // MOST)
    return blocks[np.arange(blocks.time.size) % max(every, 1) == 0]


def _wanted(blocks: _Blocks, polar: Polar) -> tuple[np.ndarray, np.ndarray]:
    """Return where depth rate and speed have a glide, boolean, and its pitch, rad, both of shape (n,)."""
    speed = np.maximum(blocks.speed, 0.05)
    sine = np.clip(-blocks.rate / speed, -0.98, 0.98)
    path = np.arcsin(sine)
    pitch, exists = path.copy(), np.ones(path.size, dtype=bool)
    for _ in range(8):
        alpha, by_pitch, _, exists = glide_angles(polar, speed, pitch)
        pitch = pitch - (pitch - path - alpha) / np.maximum(1.0 - by_pitch, 0.2)
    return (blocks.speed > 0.1) & (np.abs(sine) < 0.95) & exists & np.isfinite(pitch), pitch


def _covariance(blocks: _Blocks, vehicle: Vehicle, wanted: np.ndarray) -> np.ndarray:
    """Return the covariance of the pitch `wanted` less the logged one, shape (n, n)."""
    by_rate = (_wanted(_moved(blocks, rate=1e-4), vehicle.polar)[1] - wanted) / 1e-4
    by_speed = (_wanted(_moved(blocks, speed=1e-4), vehicle.polar)[1] - wanted) / 1e-4
    apart = np.abs(blocks.time[:, None] - blocks.time[None, :])
    water = WATER**2 * np.exp(-apart / WATER_TIME)
    out = by_rate[:, None] * water * by_rate[None, :]
    out[np.diag_indices_from(out)] += (
        blocks.pitch_variance + by_rate**2 * blocks.rate_variance + by_speed**2 * blocks.speed_variance + 1e-10
    )
    common = [by_speed * OFFSET, by_speed * blocks.speed * SCALE]
    for name in COEFFICIENTS:
        step = vehicle.std(name)
        if math.isfinite(step) and step > 0.0:
            polar = vehicle.polar._replace(**{name: getattr(vehicle.polar, name) + step})
            common.append(_wanted(blocks, polar)[1] - wanted)
    for change in common:
        out += np.outer(change, change)
    return np.asarray(out)


def _moved(blocks: _Blocks, rate: float = 0.0, speed: float = 0.0) -> _Blocks:
    """Return `blocks` with depth rate and speed changed, m/s."""
    return _Blocks(**{**vars(blocks), "rate": blocks.rate + rate, "speed": blocks.speed + speed})
