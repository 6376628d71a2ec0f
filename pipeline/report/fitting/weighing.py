"""How much depth rates scatter about the theory: what weighs them against sensors, fixes and what was known before.

Where theory leaves more of the depth rates than measurement and moving water explain, the excess is taken for slow
motion of the water. Were it not, a shape of the theory that is a little wrong would overrule everything else.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.report.fitting.regression import Problem, Solution
from pipeline.report.fitting.selection import fitted
from pipeline.report.fitting.terms import DepthRates

#: Rounds at most, and the probability below which a scatter is excessive.
ROUNDS, DOUBTED = 5, 0.025


def weighed(problem: Problem) -> tuple[Problem, float]:
    """Return the problem with depth rates that scatter as they do, and by what factor more than was assumed.

    Parameters
    ----------
    problem
        With a free set that is not refused.

    Returns
    -------
    problem, factor
        Both as they were, and 1, where the scatter is not excessive or there is no solution.
    """
    factor = 1.0
    for _ in range(ROUNDS):
        solution = fitted(problem)
        ratio = 1.0 if solution is None else _excess(problem, solution)
        if ratio <= 1.0:
            break
        factor *= ratio
        terms = (term.widened(ratio) if isinstance(term, DepthRates) else term for term in problem.terms)
        problem = replace(problem, terms=tuple(terms))
    return problem, factor


def _excess(problem: Problem, solution: Solution) -> float:
    """Return by what factor the depth rates scatter more than they are said to, 1 where it may be chance."""
    from scipy.special import chdtri

    kind = np.concatenate([np.full(term.dives.size, isinstance(term, DepthRates)) for term in problem.terms])
    freedom = int(kind.sum()) - problem.free
    chi_square = float(np.sum((solution.weights * solution.residual**2)[kind]))
    if freedom < 1 or chi_square <= float(chdtri(freedom, DOUBTED)):
        return 1.0
    return math.sqrt(chi_square / freedom)
