"""The offset between two clocks: by how many seconds the pressure's is behind the pitch's, from the flight itself.

Depth obeys ż = −A sin θ + B cos θ with A = V cos α and B = V sin α − w_w / cos θ, and depth must bend when pitch
begins and ceases to turn. V and α answer a turn too, later: at an inflexion α may be 10°, which is 20 s of the turn,
so that the zero crossing of the depth rate tells nothing. They are modelled out by what inertia and the balance of
forces do to any glider: Ȧ = g sin θ − A²/ℓ_D (1 + κ α²), α = −(ℓ_L/A²) g cos θ, with g, the net buoyancy over the
mass, an unknown random walk, and with a smooth unknown added to B. The lengths ℓ_D = m/K_D and ℓ_L = m/K_L are nearly
the same for all gliders; no coefficient, no ballast and no engine is looked at. Under power g is an acceleration along
the nose, whatever its origin. Given the lag, the likelihood is that of an extended Kalman filter for (z, A, g, B, Ḃ);
the lag is read off the profile of the likelihood, over windows around the changes of pitch.

Pitch is an input here, linear between its samples, and its noise is part of the random walk of depth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d
from scipy.optimize import minimize

#: Lags that are tried, s; a maximum at the edge is none.
REACH = 20.0
#: Pitch is turning where it spans more than this (rad) within `SPAN` s; a window reaches `MARGIN` s beyond.
TURN, SPAN, MARGIN = math.radians(3.0), 40.0, 60.0
#: A window ends at a pause of this many seconds; closer than this (m) to the surface there are waves.
PAUSE, SHALLOW = 20.0, 3.0
#: Instruments that report more seldom than this (s) do not show where a turn begins.
SELDOM = 15.0
#: Windows needed, samples in one, and samples of depth used at most: for the lag, and to find the noise levels.
WINDOWS, FEWEST, SAMPLES, TUNING = 3, 8, 20_000, 3_000
#: Where the search begins for the noise of depth (m), its random walk (m/√s), that of g (m/s² per √s) and the curvature
#: of B (m/s² per √s), and the 1-sigma of the logarithm of their squares.
START = np.log(np.square([0.03, 1e-3, 1e-2, 2e-4]))
SPREAD = np.array([3.0, 3.0, 1.0, 0.5])
#: Added to the logarithms to see what a less smooth B, three times in 1-sigma, does to the lag.
LOOSER = np.array([0.0, 0.0, 0.0, math.log(9.0)])
#: Random walks of A, for what the balance leaves out, and of w_w, m/s per √s.
SURGE, WATER = 3e-3, 8e-4
#: ℓ_D (m) with 1-sigma, ℓ_L (m), κ (rad⁻²): the vehicles with published coefficients lie near. Speed (m/s) below which
#: the lift balance is not believed.
LENGTH, LIFT, INDUCED, SLOWEST = (11.5, 2.5), 0.23, 45.0, 0.2
#: 1-sigma (rad) of α in a turn, after all: divided by the rate of turning, a time.
ATTACK = math.radians(1.2)
#: m_3/K_L (m), added mass included, with 1-sigma: divided by V, the time (s) by which the path follows the pitch.
HEAVE = (0.3, 0.08)
#: 1-sigma at which a window begins: A, g, B, Ḃ in m/s and m/s²; and the speeds (m/s) it may begin with.
BEGIN = (0.25, 0.1, 0.08, 0.004)
SPEEDS = (0.15, 2.0)


@dataclass(frozen=True)
class Lag:
    """How far the clock of depth is behind that of pitch.

    Attributes
    ----------
    value, std
        Seconds to add to the clock of depth, and 1-sigma; None if not known.
    windows
        Stretches of flight around changes of pitch that were used.
    reason
        Why the value is not known; else empty.
    """

    value: float | None
    std: float | None
    windows: int
    reason: str = ""


@dataclass(frozen=True)
class _Windows:
    """Samples of depth around changes of pitch, one window after the other, and the pitch integrated."""

    time: np.ndarray
    depth: np.ndarray
    driven: np.ndarray
    first: np.ndarray
    clock: np.ndarray
    sine: np.ndarray
    cosine: np.ndarray
    sines: np.ndarray  # integral of sine from the first sample
    cosines: np.ndarray

    @property
    def number(self) -> np.ndarray:
        """Which window each sample is in."""
        return np.asarray(np.cumsum(self.first) - 1)

    def only(self, kept: np.ndarray) -> _Windows:
        """Return the samples `kept`, whole windows."""
        parts = {name: getattr(self, name)[kept] for name in ("time", "depth", "driven", "first")}
        return replace(self, **parts)

    def thinned(self, most: int) -> _Windows:
        """Return every k-th window, so that about `most` samples are left."""
        every = -(-self.time.size // most)
        kept = self.number % max(every, 1) == every // 2
        return self.only(kept) if every > 1 and kept.any() else self

    def turned(self, lag: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the time since the sample before, and sine and cosine of pitch integrated over it, at `lag` s."""
        at = self.time + lag
        k = np.clip(np.searchsorted(self.clock, at, side="right") - 1, 0, self.clock.size - 2)
        since, step = at - self.clock[k], self.clock[k + 1] - self.clock[k]
        out = [np.diff(self.time, prepend=self.time[:1])]
        for value, integral in ((self.sine, self.sines), (self.cosine, self.cosines)):
            slope = (value[k + 1] - value[k]) / step
            out.append(np.diff(integral[k] + since * (value[k] + 0.5 * since * slope), prepend=0.0))
        return out[0], out[1], out[2]

    @cached_property
    def speed(self) -> float:
        """Speed along the nose, m/s, that the depths and pitches together mean on average."""
        _, sine, _ = self.turned(0.0)
        inside = ~self.first
        sunk = np.diff(self.depth, prepend=0.0)[inside]
        speed = -float(sunk @ sine[inside]) / max(float(sine[inside] @ sine[inside]), 1e-12)
        return float(np.clip(speed, *SPEEDS))

    @property
    def turn_rate(self) -> float:
        """How fast pitch turns where it turns, rad/s: the mean rate, weighted by its square."""
        pitch = np.arctan2(self.sine, self.cosine)
        ahead, behind = (np.interp(self.time + off, self.clock, pitch) for off in (4.0, -4.0))
        rate = np.abs(ahead - behind) / 8.0
        return max(float(np.sum(rate**3) / max(np.sum(rate**2), 1e-12)), 1e-6)

    def likelihoods(self, lag: float, levels: np.ndarray, length: float = LENGTH[0]) -> np.ndarray:
        """Return the log-likelihood of each window at `lag` s, given the logarithms of the four noise variances."""
        out = np.zeros(int(self.first.sum()))
        _filter(self.first, self.depth, self.driven, *self.turned(lag), np.exp(levels), length, self.speed, out)
        return out


def lag(time: np.ndarray, depth: np.ndarray, driven: np.ndarray, clock: np.ndarray, pitch: np.ndarray) -> Lag:
    """Return the offset between the clocks of depth and pitch.

    Parameters
    ----------
    time, depth
        Depth [m] at `time` [s], increasing, shape (n,), finite, away from the surface.
    driven
        Whether the propeller drives the vehicle at these instants, boolean of shape (n,).
    clock, pitch
        Pitch [rad] at `clock` [s], increasing, shape (k,), finite.

    Returns
    -------
    Lag
        The lag at the maximum of likelihood, and the time added by which the path follows the pitch. Its 1-sigma has
        what ℓ_D and the smoothness of B leave open, each moved, and an error of α over the rate of turning; and the
        largest of what the curvature of the profile, the profile as a distribution, and the scatter of the windows'
        scores say (the sandwich of White 1982, doi:10.2307/1912526), so that it holds where the noise is another.
    """
    if min(time.size, clock.size) < 10:
        return Lag(None, None, 0, "too few samples of depth or pitch")
    slowest = max(float(np.median(np.diff(time))), float(np.median(np.diff(clock))))
    if slowest > SELDOM:
        return Lag(None, None, 0, f"samples {slowest:.0f} s apart do not show where a change of pitch begins")
    windows = _windows(time, depth, driven, clock, pitch).thinned(SAMPLES)
    count = int(windows.first.sum())
    if count < WINDOWS:
        return Lag(None, None, count, f"{count} changes of pitch below {SHALLOW:g} m where {WINDOWS} are needed")
    some = windows.thinned(TUNING)
    grid = np.arange(-REACH, REACH + 0.5)

    def profile(levels: np.ndarray) -> np.ndarray:
        return np.array([some.likelihoods(at, levels).sum() for at in grid])

    levels = _levels(some, float(grid[int(np.argmax(profile(START)))]))
    shape = profile(levels)
    peak = float(grid[int(np.argmax(shape))])
    if not abs(peak) < REACH:
        return Lag(None, None, count, f"no offset within {REACH:g} s fits")
    value, curvature, scatter = _refined(windows, peak, levels)
    if not (curvature > 0.0 and abs(value) < REACH):
        return Lag(None, None, count, "the likelihood has no single maximum")
    weight = np.exp(shape - shape.max())
    spread = math.sqrt(float(np.sum(weight * (grid - value) ** 2) / np.sum(weight)))
    random = max(1.0 / math.sqrt(curvature), scatter, spread if spread > 1.0 else 0.0)
    moved = [
        _refined(windows, value, levels, length=sum(LENGTH))[0] - value,
        _refined(windows, value, levels + LOOSER)[0] - value,
        HEAVE[1] / windows.speed,
        ATTACK / windows.turn_rate,
    ]
    std = math.sqrt(random**2 + sum(move**2 for move in moved))
    if not math.isfinite(std):
        return Lag(None, None, count, "it cannot be told from the vehicle's own inertia")
    return Lag(value + HEAVE[0] / windows.speed, std, count)


def _windows(time: np.ndarray, depth: np.ndarray, driven: np.ndarray, clock: np.ndarray, pitch: np.ndarray) -> _Windows:
    """Return the samples of depth within `MARGIN` of a turn of pitch, not near the surface nor a start of power."""
    interval = float(np.median(np.diff(clock)))
    size = 2 * max(round(0.5 * SPAN / max(interval, 1e-3)), 1) + 1
    smooth = median_filter(pitch, 3, mode="nearest")
    turning = clock[maximum_filter1d(smooth, size) - minimum_filter1d(smooth, size) > TURN]
    switched = time[1:][driven[1:] != driven[:-1]]
    after = np.clip(np.searchsorted(clock, time), 1, clock.size - 1)
    kept = (depth > SHALLOW) & (_distance(turning, time) < MARGIN) & (_distance(switched, time) > 0.5 * SPAN)
    kept &= _distance(time[depth <= SHALLOW], time) > MARGIN
    kept &= clock[after] - clock[after - 1] < max(4.0 * interval, 5.0)
    kept &= (time > clock[0] + REACH) & (time < clock[-1] - REACH)
    t, power = time[kept], driven[kept]
    first = (np.diff(t, prepend=-np.inf) > PAUSE) | (np.diff(power, prepend=power[:1]))
    sine, cosine = np.sin(pitch), np.cos(pitch)
    step = np.diff(clock)
    sines, cosines = (np.r_[0.0, np.cumsum(0.5 * step * (x[1:] + x[:-1]))] for x in (sine, cosine))
    out = _Windows(t, depth[kept], power, first, clock, sine, cosine, sines, cosines)
    return out.only(np.bincount(out.number)[out.number] >= FEWEST) if t.size else out


def _distance(events: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return how far each `time` is from the nearest of `events`, s."""
    if not events.size:
        return np.full(time.size, np.inf)
    after = np.searchsorted(events, time)
    later, earlier = events[np.minimum(after, events.size - 1)], events[np.maximum(after - 1, 0)]
    return np.asarray(np.minimum(np.abs(later - time), np.abs(time - earlier)))


def _levels(windows: _Windows, value: float) -> np.ndarray:
    """Return the logarithms of the noise variances at the maximum of likelihood times prior, given the lag."""

    def cost(levels: np.ndarray) -> float:
        off = (levels - START) / SPREAD
        return 0.5 * float(off @ off) - float(windows.likelihoods(value, levels).sum())

    simplex = np.vstack([START, START + np.eye(4)])
    options = {"initial_simplex": simplex, "maxfev": 120, "xatol": 0.1, "fatol": 0.2}
    return np.asarray(minimize(cost, START, method="Nelder-Mead", options=options).x)


def _refined(
    windows: _Windows, value: float, levels: np.ndarray, length: float = LENGTH[0]
) -> tuple[float, float, float]:
    """Return the lag at the maximum near `value`, minus the second derivative there, and its 1-sigma by scatter."""
    step = 1.0
    move = math.inf
    for attempt in range(9):
        below, here, above = (windows.likelihoods(value + off, levels, length) for off in (-step, 0.0, step))
        slope = float((above - below).sum()) / (2.0 * step)
        bend = -float((above - 2.0 * here + below).sum()) / step**2
        if abs(move) < 0.02 or attempt == 8:
            break
        move = float(np.clip(slope / bend, -1.0, 1.0)) if bend > 0.0 else math.copysign(1.0, slope)
        value += move
    if not bend > 0.0:
        return math.nan, bend, math.nan
    score = (above - below) / (2.0 * step)
    return value, bend, math.sqrt(float(score @ score) * score.size / max(score.size - 1, 1)) / bend


@njit(cache=True, nogil=True)
def _filter(
    first: np.ndarray,
    depth: np.ndarray,
    driven: np.ndarray,
    dt: np.ndarray,
    sine: np.ndarray,
    cosine: np.ndarray,
    noise: np.ndarray,
    length: float,
    typical: float,
    out: np.ndarray,
) -> None:
    """Add the log-likelihood of each window to `out`; `sine` and `cosine` are integrals over `dt`."""
    R, walk, force, curve = noise[0], noise[1], noise[2], noise[3]
    m, P, M = np.zeros(5), np.zeros((5, 5)), np.zeros((5, 5))
    window = -1
    for k in range(depth.size):
        if first[k]:
            window += 1
            m[:], P[:] = 0.0, 0.0
            m[0], m[1], P[0, 0] = depth[k], typical, R
            for i in range(4):
                P[i + 1, i + 1] = BEGIN[i] ** 2
            continue
        h = dt[k]
        s, b = sine[k] / h, cosine[k] / h
        speed = max(m[1], SLOWEST)
        pull = 1.0 if driven[k] else s  # of g along the nose
        lean = 0.0 if driven[k] else -LIFT * b / speed  # of g into B
        drag = speed / length * (1.0 + INDUCED * (lean * m[2] / speed) ** 2)
        keep = math.exp(-2.0 * drag * h)
        held = (1.0 - keep) / (2.0 * drag)  # s, for which an acceleration lasts
        gained = held * (m[2] * pull - drag * m[1])
        by_a, by_g = -0.5 * h * s * (1.0 + keep), h * (b * lean - 0.5 * s * held * pull)
        if m[1] > SLOWEST:
            by_a -= h * b * lean * m[2] / speed
        m[0] += h * (b * (m[3] + 0.5 * h * m[4] + lean * m[2]) - s * (m[1] + 0.5 * gained))
        m[1] += gained
        m[3] += h * m[4]
        for j in range(5):
            M[0, j] = P[0, j] + by_a * P[1, j] + by_g * P[2, j] + h * b * (P[3, j] + 0.5 * h * P[4, j])
            M[1, j] = keep * P[1, j] + held * pull * P[2, j]
            M[2, j] = P[2, j]
            M[3, j] = P[3, j] + h * P[4, j]
            M[4, j] = P[4, j]
        for i in range(5):
            P[i, 0] = M[i, 0] + by_a * M[i, 1] + by_g * M[i, 2] + h * b * (M[i, 3] + 0.5 * h * M[i, 4])
            P[i, 1] = keep * M[i, 1] + held * pull * M[i, 2]
            P[i, 2] = M[i, 2]
            P[i, 3] = M[i, 3] + h * M[i, 4]
            P[i, 4] = M[i, 4]
        pulled = pull * pull * force
        P[0, 0] += walk * h + s * s * (SURGE**2 * h**3 / 3.0 + pulled * h**5 / 20.0)
        P[0, 0] += b * b * (WATER**2 * h**3 / 3.0 + curve * h**5 / 20.0)
        P[1, 1] += SURGE**2 * h + pulled * h**3 / 3.0
        P[2, 2] += force * h
        P[3, 3] += WATER**2 * h + curve * h**3 / 3.0
        P[4, 4] += curve * h
        P[0, 1] -= s * (SURGE**2 * h * h / 2.0 + pulled * h**4 / 8.0)
        P[0, 2] -= s * pull * force * h**3 / 6.0
        P[1, 2] += pull * force * h * h / 2.0
        P[0, 3] += b * (WATER**2 * h * h / 2.0 + curve * h**4 / 8.0)
        P[0, 4] += b * curve * h**3 / 6.0
        P[3, 4] += curve * h * h / 2.0
        for i in range(4):
            for j in range(i + 1, 5):
                P[j, i] = P[i, j]
        variance, gap = P[0, 0] + R, depth[k] - m[0]
        out[window] -= 0.5 * (math.log(variance) + gap * gap / variance)
        for i in range(5):
            M[0, i] = P[0, i]
        for i in range(5):
            gain = M[0, i] / variance
            m[i] += gain * gap
            for j in range(5):
                P[i, j] -= gain * M[0, j]
