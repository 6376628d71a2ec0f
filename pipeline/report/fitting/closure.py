"""GPS closure: whether a model's horizontal speed is right, by what fixes say of the current on many headings.

The velocity over ground of a passage is a V + c: the model's mean velocity through water V times a complex factor a,
and the current c. With a = (1 + β) exp(−iε), β is how much too slow the model is, relative, and ε by how much the
compass reads too little, clockwise; β = 0 when the horizontal speed is right. The current is a constant that may be
anything plus a Gauss–Markov process. Its strength and correlation time are not known either: the result is a mean over
their posterior. On one heading a current does all that a wrong speed does; on several it cannot.

The two parts of a are determined apart: a current without preferred direction makes errors along and across the
heading independent, whatever the headings.
"""

from __future__ import annotations

import math
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
#: Inverse covariance of the parts of the factor, along and across the heading, and of the constant current.
PRIOR = np.diag([0.0, TURN**-2, ANY**-2, ANY**-2])
#: What is known beforehand of the changes of a depth-average current: strength [m/s] and correlation time [s], and
#: the factor within which each lies (1-sigma), beside the values at which the posterior is taken.
STRENGTH, STRENGTH_FACTOR = 0.05, 2.0
LASTING, LASTING_FACTOR = 6.0 * 3600.0, 2.0
STEPS = np.linspace(-3.0, 3.0, 13)
#: Above this 1-sigma β is not determined.
UNDETERMINED = 0.2
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
    reason
        Why there is no β, "" where there is one.
    spread
        Circular standard deviation of the directions flown, rad.
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
    reason: str
    spread: float
    condition_index: float
    current: Current
    used: NDArray[np.bool_]
    residual: Vector


class _Fit(NamedTuple):
    """Factor, the covariance of its two parts, and the logarithm of the restricted likelihood."""

    factor: complex
    covariance: Array  # (2, 2)
    likelihood: float


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
        nothing = (math.nan, math.nan, math.nan, math.nan)
        return Closure(
            *nothing, missing, math.nan, math.inf, Current(STRENGTH, LASTING), used, _current(passages, through, 1.0)
        )
    unit = {lasting: water(passages.start[used], passages.end[used], 1.0, lasting) for _, lasting in _currents()}
    noise = np.hypot(passages.over_ground_std, through.std)[used]
    fits = {
        current: _fit(over, model, _whitener(unit[current.lasting], current.strength, noise)) for current in _currents()
    }
    weight = np.array([_prior(current) + fit.likelihood for current, fit in fits.items()])
    weight = np.exp(weight - weight.max())
    weight /= weight.sum()
    factors = np.array([fit.factor for fit in fits.values()])
    factor = complex(weight @ factors)
    size = abs(factor)
    parts = np.column_stack([(factors - factor).real, (factors - factor).imag])
    covariance = np.einsum("g,gij->ij", weight, [fit.covariance for fit in fits.values()])
    covariance += np.einsum("g,gi,gj->ij", weight, parts, parts)
    along = np.array([factor.real, factor.imag]) / size
    across = np.array([-along[1], along[0]])
    beta_std, cross_std = (math.sqrt(float(side @ covariance @ side)) for side in (along, across))
    spread, condition = _spread(model)
    reason = ""
    if beta_std > UNDETERMINED:
        reason = _undetermined(over.size, spread, beta_std)
    strength, lasting = np.exp(weight @ np.log(np.array(list(fits)))).tolist()
    return Closure(
        math.nan if reason else size - 1.0,
        beta_std,
        math.nan if reason else -math.atan2(factor.imag, factor.real),
        cross_std / size,
        reason,
        spread,
        condition,
        Current(strength, lasting),
        used,
        _current(passages, through, 1.0 if reason else factor),
    )


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


def _fit(over: Vector, model: Vector, whiten: Whitener) -> _Fit:
    """Return the generalised least squares of factor and constant current for given changes of the current."""
    over, columns = _whitened(whiten, over), _columns(whiten, model)
    normal = (columns.conj().T @ columns).real + PRIOR
    covariance = np.linalg.inv(normal)
    found = covariance @ (columns.conj().T @ over).real
    rest = over - columns @ found
    misfit = float(np.vdot(rest, rest).real + found @ PRIOR @ found)
    determinant = 2.0 * float(np.sum(np.log(whiten.factor[0])))
    likelihood = -determinant - 0.5 * misfit - 0.5 * float(np.linalg.slogdet(normal)[1])
    return _Fit(complex(*found[:2]), np.asarray(covariance[:2, :2], dtype=np.float64), likelihood)


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


def _prior(current: Current) -> float:
    """Return the logarithm of the prior density of the changes of the current, but for a constant."""
    strength = math.log(current.strength / STRENGTH) / math.log(STRENGTH_FACTOR)
    lasting = math.log(current.lasting / LASTING) / math.log(LASTING_FACTOR)
    return -0.5 * (strength**2 + lasting**2)


def _spread(model: Vector) -> tuple[float, float]:
    """Return the circular standard deviation of directions, rad, and the condition index of model and constant."""
    size = np.abs(model)
    together = float(abs(model.sum()) / size.sum())
    alike = min(float(abs(model.sum()) / math.sqrt(size.size * float(size @ size))), 1.0)
    spread = math.sqrt(-2.0 * math.log(together)) if 0.0 < together < 1.0 else (0.0 if together >= 1.0 else math.inf)
    return spread, math.sqrt((1.0 + alike) / (1.0 - alike)) if alike < 1.0 - 1e-12 else math.inf


def _undetermined(count: int, spread: float, std: float) -> str:
    if count == 1:
        return "one passage: a current does all that a wrong speed does"
    return (
        f"{count} passages whose directions spread by {math.degrees(spread):.0f} degrees do not tell speed from current"
        f" (1-sigma of β {std:.2f}); more headings would"
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
    covariance = np.linalg.inv((columns.conj().T @ columns).real + PRIOR)
    over = _whitened(whiten, passages.over_ground[rows])
    rest = root.T @ (over - columns @ (covariance @ (columns.conj().T @ over).real))
    taken = root.T @ columns
    own = np.sum(root**2, axis=0) - 0.5 * np.einsum("ij,jk,ik->i", taken, covariance, taken.conj()).real
    return np.asarray(np.abs(rest) / np.sqrt(np.maximum(own, 1e-12)), dtype=np.float64)
