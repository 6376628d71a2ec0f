"""Lyapunov functions of steady flight, whether they hold, and the region of attraction that they guarantee.

Two families in the deviations y = (V̄, γ̄, ᾱ, q̄) of `modes`: the composite function of Eq. (32) of Niu et al. (2017),
doi:10.1007/s13344-017-0061-y, printed and corrected, and a quadratic function yᵀ P y from the linearised dynamics,
which exists wherever all modes decay. That a function does not certify anything is a result, with its reason.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from pipeline.model.modes import Equilibrium, Hold, SteadyFlight, deviation_rates, equilibrium, matrix, modes
from pipeline.model.perturbation import Bounds, Formulas
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]

QUADRATIC, PRINTED, CORRECTED = 0, 1, 2

#: Weights of the four modes in the quadratic function, the slowest first: wide sets for Petrel-II, gliding or driven.
MODE_WEIGHTS = (1.0, 0.3, 5.0, 5.0)
#: Neighbourhood in which sublevel sets are sought if no other is given.
WIDE = Bounds(0.9, 0.5 * math.pi, 0.5, math.inf)

_STEPS = 100
_DIRECTIONS = 2000
_BEST = 20
_ROUNDS = 8


@dataclass(frozen=True)
class Lyapunov:
    """A function that may be a Lyapunov function of a steady flight.

    Attributes
    ----------
    kind
        `QUADRATIC`, `PRINTED` or `CORRECTED`.
    matrix
        P: near steady flight the function is yᵀ P y, shape (4, 4).
    weight
        d of Eq. (32); NaN for a quadratic function.
    ratio_alpha, ratio_pitch
        r_1 = μ/ε_1 and r_2 = μ/ε_2; NaN for a quadratic function.
    decay
        Least relative decay -v'/v of small deviations, 1/s; negative where some grow.
    holds
        Whether it is a Lyapunov function near steady flight: positive, and falling along every small motion.
    reason
        Why it is not, "" where it is.
    state
        The steady flight.
    """

    kind: int
    matrix: Array
    weight: float
    ratio_alpha: float
    ratio_pitch: float
    decay: float
    holds: bool
    reason: str
    state: Equilibrium

    def value(self, deviations: ArrayLike) -> Array:
        """Return v at `deviations` (V̄, γ̄, ᾱ, q̄), shape (..., 4); Eq. (32) or yᵀ P y. Shape (...)."""
        return self._at(deviations)[0]

    def rate(self, deviations: ArrayLike) -> Array:
        """Return v' along the motion at `deviations`, shape (..., 4), 1/s. Shape (...)."""
        return self._at(deviations)[1]

    def _at(self, deviations: ArrayLike) -> tuple[Array, Array]:
        y = np.asarray(deviations, dtype=np.float64)
        flat = np.ascontiguousarray(y.reshape(-1, 4))
        value, rate = _along(flat, self.kind, self.matrix, *self._numbers, self.state.flight)
        return value.reshape(y.shape[:-1]), rate.reshape(y.shape[:-1])

    @property
    def _numbers(self) -> tuple[float, float, float]:
        return self.weight, self.ratio_alpha, self.ratio_pitch


@dataclass(frozen=True)
class Certificate:
    """The largest sublevel set v ≤ level found inside given bounds in which v falls everywhere.

    Attributes
    ----------
    holds
        Whether there is one: whether the region of attraction is certified.
    reason
        Why there is none, "" where there is.
    function
        The function whose sublevel set it is.
    level
        Its level; NaN where there is none.
    semi_axes
        Reach along the axes V̄ [1], γ̄ [rad], ᾱ [rad], q̄ [rad], the other deviations zero, shape (4,).
    extents
        Largest |V̄|, |γ̄|, |ᾱ|, |q̄| within the set, shape (4,); NaN for the composite functions.
    limit
        Deviation that limits the level: there v' = 0, or it lies on the bounds, shape (4,).
    """

    holds: bool
    reason: str
    function: Lyapunov
    level: float
    semi_axes: Array
    extents: Array
    limit: Array


@njit(cache=True, error_model="numpy")
def _slopes(
    y: Array, kind: int, form: Array, d: float, r1: float, r2: float
) -> tuple[float, float, float, float, float]:
    """Return v and ∂v/∂(V̄, γ̄, ᾱ, q̄); Eq. (32), its correction, or yᵀ P y."""
    if kind == QUADRATIC:
        p = form @ y
        return y[0] * p[0] + y[1] * p[1] + y[2] * p[2] + y[3] * p[3], 2 * p[0], 2 * p[1], 2 * p[2], 2 * p[3]
    x, g, a, q = 1.0 + y[0], y[1], y[2], y[3]
    if kind == PRINTED:
        c1, c1_slope = r1 + x * x * (r1 + r2), 2.0 * x * (r1 + r2)
    else:
        c1, c1_slope = 1.0 + 2.0 * r2 * x * x / r1, 4.0 * r2 * x / r1
    c2, c2_slope = 1.0 + r1 / (r2 * x * x), -2.0 * r1 / (r2 * x * x * x)
    slow = 2.0 / 3.0 - x * math.cos(g) + x * x * x / 3.0
    fast = c1 * a * a + c2 * q * q + 2.0 * a * q
    return (
        (1.0 - d) * slow + 0.5 * d * fast,
        (1.0 - d) * (x * x - math.cos(g)) + 0.5 * d * (c1_slope * a * a + c2_slope * q * q),
        (1.0 - d) * x * math.sin(g),
        d * (c1 * a + q),
        d * (c2 * q + a),
    )


@njit(cache=True, error_model="numpy")
def _on(
    ray: Array, far: float, kind: int, form: Array, d: float, r1: float, r2: float, flight: SteadyFlight
) -> tuple[float, float]:
    """Return v and v' at the distance `far` along `ray`."""
    y = ray * far
    at = _slopes(y, kind, form, d, r1, r2)
    change = deviation_rates(y[0], y[1], y[2], y[3], flight)
    return at[0], at[1] * change[0] + at[2] * change[1] + at[3] * change[2] + at[4] * change[3]


@njit(cache=True, error_model="numpy")
def _along(
    points: Array, kind: int, form: Array, d: float, r1: float, r2: float, flight: SteadyFlight
) -> tuple[Array, Array]:
    """Return v and v' [1/s] at `points` of shape (n, 4), each of shape (n,); arguments as attributes of `Lyapunov`."""
    count = points.shape[0]
    value, rate = np.empty(count), np.empty(count)
    for i in range(count):
        value[i], rate[i] = _on(points[i], 1.0, kind, form, d, r1, r2, flight)
    return value, rate


@njit(cache=True, error_model="numpy")
def _lowest(
    rays: Array, bounds: Array, kind: int, form: Array, d: float, r1: float, r2: float, flight: SteadyFlight
) -> tuple[Array, Array]:
    """Return the least v on each of `rays`, shape (n, 4), where v' ≥ 0 or the ray meets the bounds, and where.

    Along each ray in steps, the first v' ≥ 0 between two steps refined by bisection.
    """
    count = rays.shape[0]
    least, where = np.empty(count), np.empty((count, 4))
    for i in range(count):
        reach = 1e12
        for k in range(4):
            if rays[i, k] != 0.0:
                reach = min(reach, bounds[k] / abs(rays[i, k]))
        edge = rays[i] * reach
        least[i], where[i] = _slopes(edge, kind, form, d, r1, r2)[0], edge
        falls = True
        for step in range(1, _STEPS + 1):
            far = reach * step / _STEPS
            value, rate = _on(rays[i], far, kind, form, d, r1, r2, flight)
            if rate < 0.0:
                falls = True
                continue
            if falls:
                near, out = reach * (step - 1) / _STEPS, far
                for _ in range(30):
                    middle = 0.5 * (near + out)
                    if _on(rays[i], middle, kind, form, d, r1, r2, flight)[1] < 0.0:
                        near = middle
                    else:
                        out = middle
                far = out
                value = _on(rays[i], far, kind, form, d, r1, r2, flight)[0]
            falls = False
            if value < least[i]:
                least[i], where[i] = value, rays[i] * far
    return least, where


def quadratic(
    state: Equilibrium, *, damping: ArrayLike | None = None, weights: tuple[float, float, float, float] = MODE_WEIGHTS
) -> Lyapunov:
    """Return a quadratic Lyapunov function yᵀ P y of a steady flight, from Aᵀ P + P A = -Q.

    Parameters
    ----------
    state
        The steady flight.
    damping
        Q, positive definite, shape (4, 4), in the deviations (V̄, γ̄, ᾱ, q̄), 1/s. If left out, P is the sum of
        squared mode amplitudes, which gives far wider sets than Q = 1: each mode's part falls at that mode's rate.
    weights
        Weights of the four modes in that sum, the slowest first; the first of a pair counts for both.

    Raises
    ------
    ValueError
        If Q is not symmetric and positive definite, or a weight is not positive.
    """
    from scipy.linalg import solve_continuous_lyapunov

    if min(weights) <= 0.0:
        raise ValueError(f"weights: found {min(weights):g}; expected positive numbers")
    found = modes(state)
    if not found.stable:
        form, reason = np.full((4, 4), np.nan), state.reason or "a mode grows, so no quadratic function falls"
        return Lyapunov(QUADRATIC, form, math.nan, math.nan, math.nan, math.nan, False, reason, state)
    if damping is not None:
        q = np.asarray(damping, dtype=np.float64)
        if q.shape != (4, 4) or not np.array_equal(q, q.T) or np.linalg.eigvalsh(q).min() <= 0.0:
            raise ValueError("damping: expected a symmetric, positive definite matrix of shape (4, 4)")
        form = solve_continuous_lyapunov(found.matrix.T, -q)
    else:
        eigenvalues, left = np.linalg.eig(found.matrix.T)
        order = np.lexsort((-eigenvalues.imag, -eigenvalues.real))
        eigenvalues, left = eigenvalues[order], left[:, order]
        shares = np.array(weights)
        shares[1:] = np.where(eigenvalues.imag[1:] < 0.0, shares[:-1], shares[1:])
        form = ((left.conj() * shares) @ left.T).real
    return _judged(Lyapunov(QUADRATIC, 0.5 * (form + form.T), *(math.nan,) * 4, False, "", state), found.matrix)


def composite(state: Equilibrium, *, weight: float | None = None, formulas: Formulas = "corrected") -> Lyapunov:
    """Return the composite function of Eq. (32), printed or corrected, of a steady flight.

    v = (1 - d) [2/3 - (1 + V̄) cos γ̄ + (1 + V̄)³/3] + d/2 {c_1 ᾱ² + [1 + r_1/(r_2 (1 + V̄)²)] q̄² + 2 ᾱ q̄}, printed
    with c_1 = r_1 + (1 + V̄)² (r_1 + r_2); the function whose derivative in the fast time is -r_2 (1 + V̄)² (ᾱ² + q̄²)
    has c_1 = 1 + 2 r_2 (1 + V̄)²/r_1. The two agree only if r_1 = r_2 = 1.

    Parameters
    ----------
    state
        The steady flight. The proof assumes a free pitch; as a candidate the function is judged in any.
    weight
        d, between 0 and 1; if left out, that of the fastest decay near steady flight.
    formulas
        ``printed`` or ``corrected``.

    Raises
    ------
    ValueError
        If d is not between 0 and 1.
    """
    if formulas not in ("printed", "corrected"):
        raise ValueError(f"formulas: found {formulas!r}; expected 'printed' or 'corrected'")
    if weight is not None and not 0.0 < weight < 1.0:
        raise ValueError(f"weight: found {weight:g}; expected a number between 0 and 1")
    kind = PRINTED if formulas == "printed" else CORRECTED
    if state.reason:
        nothing = (math.nan,) * 4
        return Lyapunov(kind, np.full((4, 4), np.nan), *nothing, False, state.reason, state)
    flight = state.flight
    slowness = -flight.body.pitch_inertia / (flight.density_ratio * flight.body.pitch_damping * flight.speed**2)
    longest = max(flight.rate_scale, slowness)
    r1, r2 = longest / flight.rate_scale, longest / slowness
    slopes = matrix(flight)

    def at(d: float) -> Lyapunov:
        c1 = r1 + (r1 + r2) if kind == PRINTED else 1.0 + 2.0 * r2 / r1
        form = np.diag([1.0 - d, 0.5 * (1.0 - d), 0.5 * d * c1, 0.5 * d * (1.0 + r1 / r2)])
        form[2, 3] = form[3, 2] = 0.5 * d
        return _judged(Lyapunov(kind, form, d, r1, r2, math.nan, False, "", state), slopes)

    if weight is not None:
        return at(weight)
    from scipy.optimize import minimize_scalar

    # The weights whose decay exceeds a given value form an interval (a linear matrix inequality), so there is one top.
    odds = np.linspace(-16.0, 16.0, 65)
    top = odds[np.argmax([at(_share(o)).decay for o in odds])]
    best = minimize_scalar(lambda o: -at(_share(o)).decay, bounds=(top - 0.5, top + 0.5), method="bounded")
    found = at(_share(best.x))
    return found if found.holds else replace(found, reason=f"{found.reason}, at any weight d")


def _share(odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-odds))


def _judged(function: Lyapunov, slopes: Array) -> Lyapunov:
    """Return the function with its verdict: P > 0 and Aᵀ P + P A < 0, by the eigenvalues relative to P."""
    if np.linalg.eigvalsh(function.matrix).min() <= 0.0:
        return replace(function, decay=-math.inf, reason="the function is not positive near steady flight")
    root = np.linalg.inv(np.linalg.cholesky(function.matrix))
    change = root @ (function.matrix @ slopes + slopes.T @ function.matrix) @ root.T
    decay = -float(np.linalg.eigvalsh(change).max())
    if decay <= 0.0:
        return replace(function, decay=decay, reason="the function grows along some small motion")
    return replace(function, decay=decay, holds=True)


def inertia_limit(
    vehicle: Vehicle,
    net_buoyancy: float,
    *,
    thrust: float | None = None,
    hold: Hold | None = None,
    largest: float = 100.0,
) -> float:
    """Return the moment of inertia J_2, kg m², up to which the corrected composite function holds for some weight d.

    At free pitch, thrust constant unless `hold` says otherwise. NaN if it fails even at 0.1 kg m²; infinite if it
    still holds at `largest`.
    """
    from scipy.optimize import brentq

    def decay(inertia: float) -> float:
        changed = vehicle.with_values({"pitch_inertia": inertia}, "limit sought")
        return composite(equilibrium(changed, net_buoyancy, thrust=thrust, hold=hold)).decay

    if not decay(0.1) > 0.0:
        return math.nan
    return math.inf if decay(largest) > 0.0 else float(brentq(decay, 0.1, largest, xtol=1e-6))


def certificate(function: Lyapunov, bounds: Bounds = WIDE) -> Certificate:
    """Return the largest sublevel set of a Lyapunov function inside `bounds` in which it falls everywhere.

    Every motion that starts in it returns to steady flight. The level is the least value of v on the bounds and where
    v' ≥ 0, sought along 2000 rays and then among ever closer neighbours of the lowest; a search, not a proof by
    intervals. The level agrees with that of another optimiser to 1e-6.

    Parameters
    ----------
    function
        From `quadratic` or `composite`.
    bounds
        Largest |V̄|, |γ̄|, |ᾱ| and |q̄|; the set touches them or v' = 0. |V̄| stays below 1.

    Raises
    ------
    ValueError
        If a bound is not positive, or that of V̄ is 1 or more.
    """
    limits = np.array(bounds, dtype=np.float64)
    if not (limits > 0.0).all() or bounds.speed >= 1.0:
        raise ValueError(f"bounds: found {tuple(bounds)}; expected positive numbers, that of speed below 1")
    nothing = np.full(4, np.nan)
    if not function.holds:
        return Certificate(False, function.reason, function, math.nan, nothing, nothing, nothing)
    arguments: tuple[Any, ...] = (function.kind, function.matrix, *function._numbers, function.state.flight)
    spread = np.linalg.inv(np.linalg.cholesky(function.matrix))
    draws = np.random.default_rng(0)
    directions = draws.standard_normal((_DIRECTIONS, 4))
    level, limit = math.inf, nothing
    for narrowing in range(_ROUNDS):
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        least, where = _lowest(directions @ spread, limits, *arguments)
        order = np.argsort(least)[:_BEST]
        if least[order[0]] < level:
            level, limit = float(least[order[0]]), where[order[0]]
        nearby = draws.standard_normal((_BEST, _DIRECTIONS // _BEST, 4)) * 0.2 * 0.3**narrowing
        directions = (directions[order][:, None] + nearby).reshape(-1, 4)
    if function.kind == QUADRATIC:
        semi_axes = np.sqrt(level / np.diag(function.matrix))
        extents = np.sqrt(level * np.diag(np.linalg.inv(function.matrix)))
    else:
        semi_axes, extents = _reach(function, level, limits), nothing
    return Certificate(True, "", function, level, semi_axes, extents, limit)


def _reach(function: Lyapunov, level: float, limits: Array) -> Array:
    """Return how far the sublevel set reaches along each axis, to its nearer side, shape (4,)."""
    from scipy.optimize import brentq

    reach = np.empty(4)
    for k, axis in enumerate(np.eye(4)):
        size = math.sqrt(level / function.matrix[k, k])
        far = min(float(limits[k]), 3.0 * size)

        def beyond(distance: float, axis: Array = axis) -> float:
            return float(max(function.value([distance * axis, -distance * axis]))) - level

        reach[k] = brentq(beyond, 0.0, far) if beyond(far) > 0.0 else far
    return reach
