"""Covariance of block means against direct integration and dense linear algebra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.report.covariance import Noise, water, with_measurement


def dense(noise: Noise) -> np.ndarray:
    size = noise.band.shape[1]
    matrix = np.zeros((size, size))
    for lag, row in enumerate(noise.band):
        for i in range(size - lag):
            matrix[i, i + lag] = matrix[i + lag, i] = row[i]
    return matrix


def integrated(start: np.ndarray, end: np.ndarray, sigma: float, tau: float, points: int = 2000) -> np.ndarray:
    """Return the covariance by the midpoint rule over both blocks."""
    grids = [a + (np.arange(points) + 0.5) * (b - a) / points for a, b in zip(start, end, strict=True)]
    return sigma**2 * np.array(
        [[np.exp(-np.abs(one[:, None] - two[None, :]) / tau).mean() for two in grids] for one in grids]
    )


def test_block_means_of_a_gauss_markov_process_match_direct_integration():
    start, end = np.array([0.0, 300.0, 900.0]), np.array([300.0, 480.0, 1200.0])
    computed = dense(water(start, end, 0.012, 250.0))
    np.testing.assert_allclose(computed, integrated(start, end, 0.012, 250.0), rtol=2e-5)


def test_a_very_short_block_has_the_variance_of_the_process():
    assert water([0.0], [1e-3], 0.02, 300.0).band[0, 0] == pytest.approx(0.02**2)


def test_blocks_far_apart_are_independent_and_the_band_stays_narrow():
    start = np.arange(50) * 1e5
    assert water(start, start + 300.0, 0.01, 300.0).band.shape == (1, 50)


def test_whitening_turns_the_covariance_into_the_identity():
    start = np.arange(12) * 350.0
    noise = with_measurement(water(start, start + 300.0, 0.01, 300.0), np.full(12, 0.002))
    matrix = dense(noise)
    lower = noise.whitener()(np.linalg.cholesky(matrix))
    np.testing.assert_allclose(lower @ lower.T, np.eye(12), atol=1e-10)
    np.testing.assert_allclose(lower, np.eye(12), atol=1e-10)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 12), st.integers(0, 1000))
def test_variance_of_a_weighted_sum_is_that_of_the_dense_matrix(size, seed):
    rng = np.random.default_rng(seed)
    start = np.cumsum(rng.uniform(200.0, 900.0, size))
    weights, factors = rng.normal(size=size), rng.normal(size=size)
    noise = water(start, start + 150.0, 0.01, 300.0).scaled(factors)
    assert noise.variance(weights) == pytest.approx(weights @ dense(noise) @ weights, rel=1e-9, abs=1e-15)
    np.testing.assert_allclose(
        dense(noise), dense(water(start, start + 150.0, 0.01, 300.0)) * np.outer(factors, factors), atol=1e-18
    )
