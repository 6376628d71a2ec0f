"""The sparse problem: what its arrays stand for."""

import numpy as np
import pytest
from problems import problem

from pipeline.estimate.problem import design, process, transition


def test_full_matrices_are_what_the_sparse_ones_stand_for() -> None:
    case = problem(5)
    F, Q, H = transition(case), process(case), design(case)
    for k in (0, 17):
        for i in range(5):
            r = list(case.coupled).index(i) if i in case.coupled else None
            expected = np.diag(case.decay[k])[i] if r is None else case.rows[k, r]
            np.testing.assert_array_equal(F[k, i], expected)
        np.testing.assert_array_equal(Q[k], Q[k].T)
        np.testing.assert_array_equal(np.diag(Q[k]), case.noise[k])
        others = np.arange(5) != case.driven
        np.testing.assert_array_equal(Q[k, case.driven, others], case.cross[k, others])
    for j in range(3):
        x = np.arange(1.0, 6.0)
        assert H[j] @ x == pytest.approx(case.weight[j] @ x[case.seen[j]])
