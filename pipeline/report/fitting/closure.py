"""GPS closure: whether a model's horizontal speed is right, by what fixes say of the current on many headings.

The velocity over ground of a passage is a V + c: the model's mean velocity through water V times a complex factor a,
and the current c. With a = (1 + β) exp(−iε), β is how much too slow the model is, relative, and ε by how much the
compass reads too little, clockwise; β = 0 when the horizontal speed is right. The current is a constant that may be
anything plus a Gauss–Markov process. Its strength and correlation time are not known either: the result is a mean over
their posterior. On one heading a current does all that a wrong speed does; on several it cannot. Which of the two
it is shows in how the 1-sigma of β follows what was assumed of the current: it grows in proportion where that alone
holds β, and not at all where the fixes do.

The two parts of a are determined apart: a current without preferred direction makes errors along and across the
heading independent, whatever the headings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.report.covariance import Noise, Whitener, water, with_measurement
from pipeline.report.fitting.passages import SEEN, Passages, ThroughWater

Array = NDArray[np.float64]
Vector = NDArray[np.complex128]

#: 1-sigma of either component of the constant current, m/s: any; and of a compass whose declination may be forgotten.
ANY, TURN = 1.0, math.radians(20.0)
#: What is known beforehand of the changes of a depth-average current: strength [m/s] and correlation time [s], and
#: the factor within which each lies (1-sigma), beside the values at which the posterior is taken.
STRENGTH, STRENGTH_FACTOR = 0.05, 2.0
LASTING, LASTING_FACTOR = 6.0 * 3600.0, 2.0
STEPS = np.linspace(-3.0, 3.0, 13)
#: Above this 1-sigma β is not determined.
UNDETERMINED = 0.2
#: Nor where more than this share of it is what was assumed of the current: found by a current so many times as free.
HELD, FREER = 0.5, 2.0
#: A passage whose velocity over ground is off by more than this many times the usual is left out; at least so many.
GATE, LEAST_FOR_GATE = 6.0, 6
#: Median length of a vector whose components have unit variance.
RAYLEIGH = math.sqrt(2.0 * math.log(2.0))


class Current(NamedTuple):
    """Changes of the current: 1-sigma of either component, m/s, and correlation time, s."""

    strength: float
    lasting: float


@dataclass(frozen=True)
class Closure:
    """What k passages say of a model's speed.

    Attributes
    ----------
    beta, beta_std
        Relative change that the horizontal speed needs; NaN where it cannot be had, the 1-sigma with it.
    turn, turn_std
        Angle, rad, by which true headings are clockwise of those logged.
    assumed
        Share of what was assumed of the current in `beta_std`, 0 to 1: d ln σ_β by d ln of the assumed strengths.
    reason
        Why there is no β, "" where there is one.
    spread
        Angular deviation of the directions flown, rad: √(2 (1 − R)) with their mean resultant length R (Batschelet
        1981, Circular Statistics in Biology), 0 on one heading and √2, 81 degrees, on all.
    condition_index
        Of factor and constant current, columns scaled to length one.
    current
        How much the current changes: means of logarithms over the posterior.
    used
        Which passages entered, boolean of shape (k,).
    residual
        Current of each passage by the factor found, m/s, shape (k,); by the model as it is where there is none.
    """

    beta: float
    beta_std: float
    turn: float
    turn_std: float
    assumed: float
    reason: str
    spread: float
    condition_index: float
    current: Current
    used: NDArray[np.bool_]
    residual: Vector


class _Whitened(NamedTuple):
    """Velocities over ground and the columns of `_columns`, white if the current changes so, and ln of a determinant.

    The latter is that of the covariance of one component.
    """

    over: Vector
    columns: Vector
    determinant: float


class _Posterior(NamedTuple):
    """Factor, the covariance of its two parts, shape (2, 2), and the probability of each current."""

    factor: complex
    covariance: Array
    weight: Array

    @property
    def along(self) -> Array:
        """Direction of the factor as a unit vector."""
        return np.array([self.factor.real, self.factor.imag]) / abs(self.factor)

    @property
    def beta_std(self) -> float:
        """1-sigma of the length of the factor."""
        return math.sqrt(self.along @ self.covariance @ self.along)


def close(passages: Passages, through: ThroughWater) -> Closure:
    """Return what the passages say of a model's horizontal speed.

    Parameters
    ----------
    passages
        Between fixes.
    through
        The model's velocity through water in each, as from `passages.through_water`.
    """
    used = np.isfinite(through.velocity) & (through.seen >= SEEN)
    missing = passages.reason or ("" if used.any() else "the model's speed is not known in any passage")
    while not missing:
        worst = _astray(passages, through, used)
        if worst < 0:
            break
        used[worst] = False
    over, model = passages.over_ground[used], through.velocity[used]
    if missing or not np.any(np.abs(model) > 0.0):
        missing = missing or "the model does not move"
        nothing = (math.nan, math.nan, math.nan, math.nan, math.nan)
        return Closure(
            *nothing, missing, math.nan, math.inf, Current(STRENGTH, LASTING), used, _current(passages, through, 1.0)
        )
    noise = np.hypot(passages.over_ground_std, through.std)[used]
    white = _by_current(passages.start[used], passages.end[used], over, model, noise)
    found, freer = _posterior(white), _posterior(white, FREER)
    assumed = math.log(freer.beta_std / found.beta_std) / math.log(FREER)
    across = np.array([-found.along[1], found.along[0]])
    cross_std = math.sqrt(across @ found.covariance @ across)
    spread, condition = _spread(model)
    reason = ""
    if assumed > HELD or found.beta_std > UNDETERMINED:
        reason = _undetermined(over.size, spread, assumed, found.beta_std, freer.beta_std)
    strength, lasting = np.exp(found.weight @ np.log(np.array(list(white)))).tolist()
    size = abs(found.factor)
    return Closure(
        math.nan if reason else size - 1.0,
        found.beta_std,
        math.nan if reason else -math.atan2(found.factor.imag, found.factor.real),
        cross_std / size,
        assumed,
        reason,
        spread,
        condition,
        Current(strength, lasting),
        used,
        _current(passages, through, 1.0 if reason else found.factor),
    )


def _by_current(start: Array, end: Array, over: Vector, model: Vector, noise: Array) -> dict[Current, _Whitened]:
    """Return the measurements made white for each way the current may change."""
    unit = {lasting: water(start, end, 1.0, lasting) for _, lasting in _currents()}
    out = {}
    for current in _currents():
        whiten = _whitener(unit[current.lasting], current.strength, noise)
        determinant = 2.0 * float(np.sum(np.log(whiten.factor[0])))
        out[current] = _Whitened(_whitened(whiten, over), _columns(whiten, model), determinant)
    return out


def _posterior(white: Mapping[Current, _Whitened], freedom: float = 1.0) -> _Posterior:
    """Return factor and current after the data, the current assumed `freedom` times as strong as it is."""
    fits = [_fit(each, freedom) for each in white.values()]
    weight = np.array([_prior(current, freedom) + fit[2] for current, fit in zip(white, fits, strict=True)])
    weight = np.exp(weight - weight.max())
    weight /= weight.sum()
    factors = np.array([fit[0] for fit in fits])
    factor = complex(weight @ factors)
    parts = np.column_stack([(factors - factor).real, (factors - factor).imag])
    covariance = np.einsum("g,gij->ij", weight, [fit[1] for fit in fits])
    covariance += np.einsum("g,gi,gj->ij", weight, parts, parts)
    return _Posterior(factor, covariance, weight)


def _whitener(unit: Noise, strength: float, noise: Array) -> Whitener:
    """Return what whitens velocities over ground, but for a constant current.

    Parameters
    ----------
    unit
        Covariance of means of a current that changes by 1 m/s.
    strength
        By how much it does, m/s.
    noise
        1-sigma of either component by anything but the current, m/s, shape (k,).
    """
    return with_measurement(Noise(strength**2 * unit.band), np.maximum(noise, 1e-4)).whitener()


def _fit(white: _Whitened, freedom: float) -> tuple[complex, Array, float]:
    """Return factor, covariance of its two parts and logarithm of the restricted likelihood for given changes.

    Generalised least squares of factor and constant current.
    """
    prior = _information(freedom)
    normal = (white.columns.conj().T @ white.columns).real + prior
    covariance = np.linalg.inv(normal)
    found = covariance @ (white.columns.conj().T @ white.over).real
    rest = white.over - white.columns @ found
    misfit = float(np.vdot(rest, rest).real + found @ prior @ found)
    likelihood = -white.determinant - 0.5 * misfit - 0.5 * float(np.linalg.slogdet(normal)[1])
    return complex(*found[:2]), np.asarray(covariance[:2, :2], dtype=np.float64), likelihood


def _information(freedom: float = 1.0) -> Array:
    """Return the inverse covariance beforehand of the parts of the factor and of the constant current, shape (4, 4).

    The part along the heading is free, that across it by a compass; the current is `freedom` times `ANY`.
    """
    return np.diag([0.0, TURN**-2, (freedom * ANY) ** -2, (freedom * ANY) ** -2])


def _columns(whiten: Whitener, model: Vector) -> Vector:
    """Return what the two parts of the factor and of the constant current add to the velocities, whitened, (k, 4)."""
    along, constant = _whitened(whiten, model), whiten(np.ones(model.size))
    return np.column_stack([along, 1j * along, constant, 1j * constant])


def _whitened(whiten: Whitener, values: Vector) -> Vector:
    parts = whiten(np.column_stack([values.real, values.imag]))
    return np.asarray(parts[:, 0] + 1j * parts[:, 1])


def _currents() -> list[Current]:
    """Return the changes of the current at which the posterior is taken."""
    return [
        Current(STRENGTH * STRENGTH_FACTOR**strength, LASTING * LASTING_FACTOR**lasting)
        for strength in STEPS
        for lasting in (-1.5, 0.0, 1.5)
    ]


def _prior(current: Current, freedom: float) -> float:
    """Return the logarithm of the prior density of the changes of the current, but for a constant."""
    strength = math.log(current.strength / (freedom * STRENGTH)) / math.log(STRENGTH_FACTOR)
    lasting = math.log(current.lasting / LASTING) / math.log(LASTING_FACTOR)
    return -0.5 * (strength**2 + lasting**2)


def _spread(model: Vector) -> tuple[float, float]:
    """Return the angular deviation of directions, rad, and the condition index of model and constant."""
    size = np.abs(model)
    together = float(abs(model.sum()) / size.sum())
    alike = min(float(abs(model.sum()) / math.sqrt(size.size * float(size @ size))), 1.0)
    return math.sqrt(2.0 * max(1.0 - together, 0.0)), math.sqrt(
        (1.0 + alike) / (1.0 - alike)
    ) if alike < 1.0 - 1e-12 else math.inf


def _undetermined(count: int, spread: float, assumed: float, std: float, freer: float) -> str:
    """Return why β is not determined, and what would."""
    alike = f"{count} passages whose directions spread by {math.degrees(spread):.0f} degrees"
    if count == 1:
        words = "one passage: a current does all that a wrong speed does"
    elif assumed > HELD:
        words = f"{alike}: what was assumed of the current decides β, not the fixes"
    else:
        return f"{alike} do not tell speed from current (1-sigma of β {std:.2f}); passages on reciprocal headings would"
    return (
        f"{words} (1-sigma of β {std:.2f}, with a current twice as free {freer:.2f}); more passages on reciprocal "
        "headings would tell"
    )


def _current(passages: Passages, through: ThroughWater, factor: complex) -> Vector:
    """Return the current of each passage if the model's velocity is to be multiplied by a factor."""
    return np.asarray(passages.over_ground - factor * through.velocity)


def _astray(passages: Passages, through: ThroughWater, used: NDArray[np.bool_]) -> int:
    """Return the passage that the others contradict most, −1 if none does.

    What it is off by is compared with what the others are off by once it is gone, so that a current stronger than
    expected makes no outliers.
    """
    rows = np.flatnonzero(used)
    if rows.size < LEAST_FOR_GATE:
        return -1
    off = _off(passages, through, rows)
    worst = int(np.argmax(off))
    usual = float(np.median(_off(passages, through, np.delete(rows, worst)))) / RAYLEIGH
    return int(rows[worst]) if off[worst] > GATE * max(usual, 1.0) else -1


def _off(passages: Passages, through: ThroughWater, rows: NDArray[np.intp]) -> Array:
    """Return how far the velocity over ground of each of `rows` is from what the others predict, over its 1-sigma."""
    noise = np.hypot(passages.over_ground_std, through.std)[rows]
    unit = water(passages.start[rows], passages.end[rows], 1.0, LASTING)
    whiten = _whitener(unit, STRENGTH, noise)
    root, columns = whiten(np.eye(rows.size)), _columns(whiten, through.velocity[rows])
    covariance = np.linalg.inv((columns.conj().T @ columns).real + _information())
    over = _whitened(whiten, passages.over_ground[rows])
    rest = root.T @ (over - columns @ (covariance @ (columns.conj().T @ over).real))
    taken = root.T @ columns
    own = np.sum(root**2, axis=0) - 0.5 * np.einsum("ij,jk,ik->i", taken, covariance, taken.conj()).real
    return np.asarray(np.abs(rest) / np.sqrt(np.maximum(own, 1e-12)), dtype=np.float64)
