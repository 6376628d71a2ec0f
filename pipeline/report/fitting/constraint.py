"""The closure as a constraint: residuals of passages over ground for a fit whose unknowns are the theory's corrections.

The model's velocity through water, a sum over steady blocks, plus a current must give the velocity over ground. The
current and the error of the compass are not fitted: what they may be is in the covariance of the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.report.covariance import water
from pipeline.report.fitting.closure import ANY, TURN, Closure, close
from pipeline.report.fitting.passages import SEEN, UNSEEN, Passages, ThroughWater, by_blocks

Array = NDArray[np.float64]

#: Fewer passages than this constrain nothing: the current may be anything.
LEAST = 2


@dataclass(frozen=True)
class Constraint:
    """Velocities over ground of k passages, as a function of the horizontal speeds of b blocks.

    Attributes
    ----------
    over_ground
        East components, then north components, m/s, shape (2k,).
    weights
        Sparse array of shape (2k, b): times the horizontal speeds, the velocities through water.
    root
        Lower Cholesky factor of the covariance of the residuals, shape (2k, 2k).
    closure
        What the passages say of the speeds that the fit begins with.
    """

    over_ground: Array
    weights: Any
    root: Array
    closure: Closure

    @property
    def size(self) -> int:
        """Number of residuals."""
        return int(self.over_ground.size)

    def residuals(self, speed: Array) -> Array:
        """Return velocities over ground less those through water, whitened.

        Parameters
        ----------
        speed
            Horizontal speeds of the blocks, m/s, shape (b,).

        Returns
        -------
        ndarray
            Of unit variance if the speeds are right, shape (2k,).
        """
        return self._white(self.over_ground - self.weights @ speed)

    def jacobian(self, slopes: Array) -> Array:
        """Return the derivatives of `residuals`.

        Parameters
        ----------
        slopes
            Derivatives of the horizontal speeds, shape (b, n).

        Returns
        -------
        ndarray
            Shape (2k, n).
        """
        return self._white(-(self.weights @ slopes))

    def _white(self, values: Array) -> Array:
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.root, values, lower=True))


def constrain(passages: Passages, start: Array, end: Array, speed: Array) -> tuple[Constraint | None, str]:
    """Return the constraint that passages put on the horizontal speeds of blocks, or why there is none.

    How much the current changes is found beforehand, with the speeds free by a factor.

    Parameters
    ----------
    passages
        Between fixes.
    start, end
        Bounds of the blocks, s since 1970-01-01 UTC, in time order, shape (b,).
    speed
        Horizontal speeds V cos γ that the fit begins with, m/s, shape (b,).
    """
    if passages.reason:
        return None, passages.reason
    weights, seen = by_blocks(passages, start, end)
    through = mean_of(weights, seen, speed)
    closure = close(passages, through)
    used = np.flatnonzero(closure.used)
    if used.size < LEAST:
        return None, f"{used.size} passages between fixes with steady flight: at least {LEAST} are needed"
    noise = np.hypot(passages.over_ground_std, through.std)[used]
    changing = dense(water(passages.start[used], passages.end[used], *closure.current).band)
    # Components of the current are independent; the turn of the compass moves both.
    covariance = np.kron(np.eye(2), changing + np.diag(noise**2) + ANY**2)
    across = TURN * 1j * through.velocity[used]
    turn = np.concatenate([across.real, across.imag])
    covariance += np.outer(turn, turn)
    over = passages.over_ground[used]
    from scipy.sparse import vstack

    return (
        Constraint(
            np.concatenate([over.real, over.imag]),
            vstack([weights[used].real, weights[used].imag]).tocsr(),
            np.linalg.cholesky(covariance),
            closure,
        ),
        "",
    )


def mean_of(weights: Any, seen: Array, speed: Array) -> ThroughWater:
    """Return what the horizontal speeds of blocks make of each passage.

    Parameters
    ----------
    weights, seen
        As from `passages.by_blocks`.
    speed
        m/s, shape (b,); NaN where the theory has none, and then the passage has none.
    """
    velocity = weights @ speed
    return ThroughWater(velocity, UNSEEN * np.abs(velocity) * (1.0 - seen), np.where(seen >= SEEN, seen, 0.0))


def dense(band: Array) -> Array:
    """Return the symmetric matrix whose lower band is given, shape (n, n) of (w + 1, n)."""
    n = band.shape[1]
    matrix = np.zeros((n, n))
    for lag, values in enumerate(band[:n]):
        rows = np.arange(n - lag)
        matrix[rows, rows + lag] = matrix[rows + lag, rows] = values[: n - lag]
    return matrix
