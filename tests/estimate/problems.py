"""Random problems with gaps, and what is known of them from elsewhere."""

from __future__ import annotations

import numpy as np

from pipeline.estimate.problem import Problem, design, process, transition

#: States and coupled rows; the compiled engine is made anew for each pair, which takes seconds.
SIZES = ((5, 2), (4, 1))


def problem(
    seed: int,
    m: int = 40,
    size: tuple[int, int] = SIZES[0],
    p: int = 3,
    missing: float = 0.4,
    considered: int = 0,
    decades: float = 0.0,
) -> Problem:
    """Return a random problem with gaps, `size` states and coupled rows, and measurements of one state or of two.

    Variances spread over so many `decades`, each instant's anew.
    """
    rng, (n, r) = np.random.default_rng(seed), size
    coupled = np.sort(rng.permutation(n)[:r])
    rows = 0.3 * rng.standard_normal((m, r, n))
    rows[:, np.arange(r), coupled] = 1.0

    def spread(*size: int) -> np.ndarray:
        return rng.uniform(0.1, 1.0, size) * 10.0 ** (decades * (rng.random(size) - 0.5))

    noise, driven = spread(m, n), int(rng.integers(n))
    share = rng.dirichlet(np.ones(n), m)
    cross = rng.choice([-0.9, 0.9], (m, n)) * np.sqrt(share * noise * noise[:, [driven]])
    cross[:, driven] = 0.0
    seen = rng.integers(0, n, (p, 2))
    seen[:, 1] = (seen[:, 0] + rng.integers(1, n, p)) % n
    weight = rng.standard_normal((p, 2))
    weight[::2, 1] = 0.0
    observed = rng.standard_normal((m, p))
    observed[rng.random((m, p)) < missing] = np.nan
    return Problem(
        rng.standard_normal(n),
        np.diag(spread(n)),
        rng.uniform(0.5, 1.0, (m, n)),
        coupled,
        rows,
        rng.standard_normal((m, r, 1 + considered)),
        noise,
        cross,
        driven,
        seen,
        weight,
        observed,
        rng.standard_normal((p, considered)),
        spread(m, p),
    )


def shift_of(case: Problem) -> np.ndarray:
    """Return what is added to each state, (m, n)."""
    full = np.zeros(case.decay.shape)
    full[:, case.coupled] = case.shift[:, :, 0]
    return full


def dense(case: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Solve for all states at once by normal equations: mean (m, n) and covariance (m, n, n)."""
    m, n = case.observed.shape[0], case.mean_0.size
    F, Q, H, shift = transition(case), process(case), design(case), shift_of(case)
    information, vector = np.zeros((m * n, m * n)), np.zeros(m * n)
    prior = np.linalg.inv(case.covariance_0)
    information[:n, :n] += prior
    vector[:n] += prior @ case.mean_0
    for k in range(m - 1):
        weight = np.linalg.inv(Q[k])
        row = np.zeros((n, m * n))
        row[:, k * n : (k + 1) * n] = -F[k]
        row[:, (k + 1) * n : (k + 2) * n] = np.eye(n)
        information += row.T @ weight @ row
        vector += row.T @ weight @ shift[k]
    for k, j in np.argwhere(np.isfinite(case.observed)):
        row = np.zeros(m * n)
        row[k * n : (k + 1) * n] = H[j]
        information += np.outer(row, row) / case.variance[k, j]
        vector += row * case.observed[k, j] / case.variance[k, j]
    covariance = np.linalg.inv(information)
    blocks = np.stack([covariance[k * n : (k + 1) * n, k * n : (k + 1) * n] for k in range(m)])
    return (covariance @ vector).reshape(m, n), blocks


def simulated(case: Problem, rng: np.random.Generator) -> Problem:
    """Return the problem with measurements drawn from the model itself, missing where they were."""
    F, Q, H, shift = transition(case), process(case), design(case), shift_of(case)
    x = rng.multivariate_normal(case.mean_0, case.covariance_0)
    observed = case.observed.copy()
    for k in range(len(observed)):
        y = H @ x + np.sqrt(case.variance[k]) * rng.standard_normal(len(H))
        observed[k] = np.where(np.isnan(observed[k]), np.nan, y)
        x = F[k] @ x + shift[k] + rng.multivariate_normal(np.zeros(x.size), Q[k])
    return case._replace(observed=observed)
