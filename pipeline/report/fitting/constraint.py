"""The closure as a constraint on the fit: the theory's velocity through water plus a current is that over ground.

The current and the error of the compass are not fitted: what they may be is in the covariance of the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.report.covariance import water
from pipeline.report.fitting.closure import ANY, TURN, Closure, Current, close
from pipeline.report.fitting.model import Flight, Model
from pipeline.report.fitting.passages import SEEN, Passages, by_blocks, mean_of
from pipeline.report.fitting.points import Array, Points

#: Fewer passages than this constrain nothing: the current may be anything.
LEAST = 2


@dataclass(frozen=True)
class Displacements:
    """Velocities over ground of k passages against the theory at n blocks; a `terms.Constraint`.

    Attributes
    ----------
    passages, points
        Between fixes; blocks.
    speed
        Horizontal speed of each block by the theory that the fit begins with, m/s, shape (n,).
    closure
        What the passages of the whole mission say of these speeds.
    dives
        Dive of each residual, shape (2k,): the east components, then the north ones.
    over_ground
        East components, then north ones, m/s, shape (2k,).
    weights
        Sparse array of shape (2k, n): times the horizontal speeds, the velocities through water.
    root
        Lower Cholesky factor of the covariance of the residuals, shape (2k, 2k).
    """

    passages: Passages
    points: Points
    speed: Array
    closure: Closure
    dives: NDArray[np.int64]
    over_ground: Array
    weights: Any
    root: Array
    name: str = "displacements between fixes"

    @classmethod
    def made(cls, passages: Passages, model: Model) -> Displacements:
        """Return the constraint that passages put on a theory at its blocks.

        How much the current changes is found beforehand, with all speeds free by a common factor.

        Parameters
        ----------
        passages
            Between fixes.
        model
            The theory that the fit begins with.
        """
        points = model.points
        speed = model.fly(np.zeros(len(model.names))).horizontal_speed
        weights, seen = by_blocks(passages, points.start, points.end)
        closure = close(passages, mean_of(weights, seen, speed))
        return cls._of(passages, points, speed, closure)

    @classmethod
    def _of(cls, passages: Passages, points: Points, speed: Array, closure: Closure) -> Displacements:
        from scipy.sparse import vstack

        weights, seen = by_blocks(passages, points.start, points.end)
        through = mean_of(weights, seen, speed)
        used = np.flatnonzero(closure.used & np.isfinite(through.velocity) & (through.seen >= SEEN))
        if used.size < LEAST:
            used = used[:0]
        velocity, over = through.velocity[used], passages.over_ground[used]
        noise = np.hypot(passages.over_ground_std, through.std)[used]
        return cls(
            passages,
            points,
            speed,
            closure,
            np.tile(passages.dive[used], 2),
            np.concatenate([over.real, over.imag]),
            vstack([weights[used].real, weights[used].imag]).tocsr(),
            np.asarray(
                np.linalg.cholesky(_covariance(passages, used, velocity, noise, closure.current)), dtype=np.float64
            ),
        )

    @property
    def tells_speed(self) -> bool:
        """Whether the headings tell speed from current."""
        return self.dives.size > 0 and not self.closure.reason

    def of(self, points: Points) -> Displacements:
        """Return the same constraint for other blocks of the mission, and the passages that they fill."""
        known = dict(zip(self.points.block.tolist(), self.speed.tolist(), strict=True))
        speed = np.array([known[block] for block in points.block.tolist()])
        return Displacements._of(self.passages, points, speed, self.closure)

    def residual(self, flight: Flight) -> Array:
        """Return velocities over ground less those through water, whitened, shape (2k,).

        A block that the theory cannot fly counts as it did when the fit began.
        """
        speed = np.where(np.isfinite(flight.horizontal_speed), flight.horizontal_speed, self.speed)
        return self._white(self.over_ground - self.weights @ np.nan_to_num(speed))

    def jacobian(self, flight: Flight) -> Array:
        """Return the slopes of `residual` in the corrections, shape (2k, m)."""
        return self._white(-(self.weights @ np.nan_to_num(flight.horizontal_speed_by)))

    def _white(self, values: Array) -> Array:
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.root, values, lower=True)) if values.size else values


def told_by(passages: Passages, model: Model) -> tuple[Displacements, ...]:
    """Return the constraint on a theory, or nothing where the headings do not tell speed from current.

    Parameters
    ----------
    passages
        Between fixes.
    model
        The theory that the fit begins with, at its blocks.
    """
    made = Displacements.made(passages, model)
    return (made,) if made.tells_speed else ()


def _covariance(
    passages: Passages, used: NDArray[np.intp], velocity: NDArray[np.complex128], noise: Array, current: Current
) -> Array:
    """Return the covariance of velocities over ground less those through water, (m/s)², shape (2k, 2k)."""
    changing = dense(water(passages.start[used], passages.end[used], *current).band)
    across = TURN * 1j * velocity
    turn = np.concatenate([across.real, across.imag])  # the compass is off by one angle in all passages
    return np.asarray(np.kron(np.eye(2), changing + np.diag(noise**2) + ANY**2) + np.outer(turn, turn))


def dense(band: Array) -> Array:
    """Return the symmetric matrix whose lower band is given, shape (n, n) of (w + 1, n)."""
    n = band.shape[1]
    matrix = np.zeros((n, n))
    for lag, values in enumerate(band[:n]):
        rows = np.arange(n - lag)
        matrix[rows, rows + lag] = matrix[rows + lag, rows] = values[: n - lag]
    return matrix
