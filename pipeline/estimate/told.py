"""What the measurements tell of the considered parameters, where they are allowed to: bias-separated estimation.

The smoother carries the estimate together with its derivative with respect to each considered parameter. The
innovations and their derivatives are then the normal equations of those parameters, and the estimate moves along with
them: the same as a filter that has them as states, at no cost in states (Friedland 1969,
doi:10.1109/TAC.1969.1099223).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.estimate.kalman import innovations
from pipeline.estimate.problem import Problem


class Told(NamedTuple):
    """What is known of c considered parameters, per their 1-sigma before."""

    value: np.ndarray  # (c,)
    covariance: np.ndarray  # (c, c)

    def beside(self, others: int) -> Told:
        """Return the same with so many `others` behind, of which nothing is told."""
        c = self.value.size
        covariance = np.eye(c + others)
        covariance[:c, :c] = self.covariance
        return Told(np.append(self.value, np.zeros(others)), covariance)

    def moved(self, mean: np.ndarray) -> np.ndarray:
        """Return what `mean`, shape (…, 1 + c), a value and its changes, becomes."""
        return np.asarray(mean[..., 0] + mean[..., 1:] @ self.value)

    def left_open(self, mean: np.ndarray) -> np.ndarray:
        """Return the variance that the parameters still leave in `mean`, shape (…)."""
        return np.asarray(np.sum((mean[..., 1:] @ self.covariance) * mean[..., 1:], axis=-1))


def nothing(parameters: int) -> Told:
    """Return what is known of `parameters` that the measurements are not allowed to change."""
    return Told(np.zeros(parameters), np.eye(parameters))


def told(problem: Problem, where: np.ndarray) -> Told:
    """Return what measurements tell of the considered parameters of `problem`.

    Parameters
    ----------
    problem
        The state-space problem; m instants.
    where
        Instants whose innovations count, boolean of shape (m,). The filter has seen all measurements before them.
    """
    found, variance = innovations(problem)
    known = np.isfinite(variance) & where[:, None]
    whitened = found[known] / np.sqrt(variance[known])[:, None]
    residual, slope = whitened[:, 0], whitened[:, 1:]
    covariance = np.linalg.inv(np.eye(slope.shape[1]) + slope.T @ slope)
    return Told(-covariance @ (slope.T @ residual), covariance)
