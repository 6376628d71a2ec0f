"""The kinematic model written for filterpy: its extended Kalman filter, the model in Python, the smoother in numpy.

The model is that of `pipeline.estimate.linearise` without fixes and speed sensor. Each step is linearised where the
filter is; functions give state, Jacobian and noise, as filterpy's documentation has it.
"""

from __future__ import annotations

import math

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from pipeline.estimate.linearise import SPAN, STEEPEST_TURN, depth_at_start
from pipeline.estimate.linearise import integrated as compiled
from pipeline.estimate.series import Series
from pipeline.estimate.settings import Settings
from pipeline.model import closure
from pipeline.vehicle import Polar

SEEN = np.eye(6)[[2, 1]]  # depth and pitch of V, θ, z, w_w, δ, κ
integrated = compiled.py_func


class Glider(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy is untyped
    """V, θ, z, w_w, δ and κ of a glider; needs the closure as plain Python."""

    def __init__(self, series: Series, polar: Polar, settings: Settings, speed: float) -> None:
        """Start at V = `speed`, level."""
        super().__init__(dim_x=6, dim_z=2)
        s = settings
        self.series, self.polar, self.settings = series, polar, settings
        self.best = closure.best_glides(polar, polar.parasite_drag)
        self.x = np.array([speed, float(series.pitch_guess[0]), depth_at_start(series), 0.0, 0.0, s.response])
        self.P = np.diag([s.initial_speed, 0.2, 5.0, s.sigma_w, s.slip_manoeuvre, s.response]) ** 2
        self.now, self.alpha = 0, math.nan

    def predict_x(self, u: object = 0) -> None:
        """Move the state on by one record; F and Q are those of this step."""
        series, polar, s, k = self.series, self.polar, self.settings, self.now
        quick, powered, surfaced = series.manoeuvre[k], series.powered[k], series.surfaced[k]
        dt = float(series.time[k + 1] - series.time[k])
        met = series.stratification[k]
        v, pitch, depth, water, slip, response = self.x.tolist()
        v = max(v, s.least_speed)
        alpha, by_pitch, _, steady = closure.glide_near(polar, polar.parasite_drag, self.best, v, pitch, self.alpha)
        self.alpha, share = alpha, 0.0 if powered else 1.0
        gamma = pitch - share * alpha - slip
        sine, cosine = math.sin(gamma), math.cos(gamma)
        slowing = 0.0 if math.isnan(met) or surfaced else met * dt / v
        turned = 0.0
        if surfaced:
            drift = s.speed_drift_surface
        elif quick and series.gentle[k]:
            drift = s.speed_drift_gentle
        elif quick:
            drift = s.speed_drift_manoeuvre + s.speed_turn * series.turning[k] + s.initial_speed**2 * series.loose[k]
        elif math.isnan(met):
            drift = s.speed_drift_blind
        else:
            drift = s.speed_drift + (s.stratification * v) ** 2 * met
            if powered or not steady:
                drift += (0.5 * v) ** 2 * s.pitch_drift * min(cosine**2 / max(sine**2, 1e-3), 25.0)
            else:
                drag = polar.parasite_drag + polar.induced_drag * alpha**2
                turned = 0.5 * cosine / sine * (1.0 - by_pitch) - polar.induced_drag * alpha * by_pitch / drag
                turned = min(max(turned, -STEEPEST_TURN), STEEPEST_TURN)
                drift += (s.pitch_share * turned * v) ** 2 * s.pitch_drift
                turned *= series.pitch_guess[k + 1] - series.pitch_guess[k]
            drift *= s.unsteadiness
        turning = s.pitch_drift_manoeuvre if quick else s.pitch_drift
        sigma, tau = (s.slip_manoeuvre, s.slip_time_manoeuvre) if quick else (s.slip, s.slip_time)
        if powered:
            sigma, tau = max(sigma, SPAN * abs(alpha)), s.slip_time_powered if series.gentle[k] and not quick else tau
        if not steady:
            sigma = max(sigma, s.slip_manoeuvre)
        phi_w, phi_s = math.exp(-dt / s.tau_w), math.exp(-dt / tau)
        w_weight, w_var, w_cov, w_int = integrated(s.sigma_w, s.tau_w, dt, phi_w)
        s_weight, s_var, s_cov, s_int = integrated(sigma, tau, dt, phi_s)
        z_v, z_t, z_s = -math.sin(gamma + slip), -v * cosine * (1.0 - share * by_pitch), v * cosine
        rate = -v * sine
        if series.cruising[k]:
            z_v = 0.0
        if surfaced:
            rate = z_v = z_t = z_s = w_weight = w_cov = w_int = 0.0
        self.F = np.array(
            [
                [1.0 + turned + response * slowing / v, 0.0, 0.0, 0.0, 0.0, -slowing],
                [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
                [z_v * dt, z_t * dt, 1.0, -w_weight, z_s * s_weight, 0.0],
                [0.0, 0.0, 0.0, phi_w, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, phi_s, 0.0],
                [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            ]
        )
        heave = s.swell + (s.heave_drift if surfaced or quick else 0.0)
        walked = (z_v**2 * drift + z_t**2 * turning) * dt**3 / 3.0 + w_int + z_s**2 * s_int + heave * dt
        self.Q = np.diag([drift * dt, turning * dt, walked, w_var, s_var, s.response_drift * dt if quick else 0.0])
        self.Q[2, [0, 1, 3, 4]] = 0.5 * z_v * drift * dt**2, 0.5 * z_t * turning * dt**2, -w_cov, z_s * s_cov
        self.Q[[0, 1, 3, 4], 2] = self.Q[2, [0, 1, 3, 4]]
        self.x = np.array(
            [
                v * (1.0 + turned) - response * slowing,
                pitch,
                depth + rate * dt - w_weight * water + z_s * (s_weight - dt) * slip,
                phi_w * water,
                phi_s * slip,
                response,
            ]
        )
        self.now += 1


def smoothed(series: Series, polar: Polar, settings: Settings, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return states (m, 6) and covariances (m, 6, 6) in one pass forth and one back.

    Parameters
    ----------
    series
        Measurements and flags, m instants.
    polar, settings
        Coefficients, without a drag exponent, and noise levels.
    speed
        V to start from, m/s.
    """
    m = series.time.size
    ekf = Glider(series, polar, settings, speed)
    (x, x_ahead), (P, P_ahead, F) = np.empty((2, m, 6)), np.empty((3, m, 6, 6))
    measured = np.stack([series.depth, series.pitch], axis=1)
    noise = np.diag([settings.depth_noise, settings.pitch_noise]) ** 2
    for k in range(m):
        known = ~np.isnan(measured[k])
        if known.any():
            H = SEEN[known]
            ekf.update(
                measured[k][known], lambda _, H=H: H, lambda state, H=H: H @ state, R=noise[np.ix_(known, known)]
            )
        x[k], P[k] = ekf.x, ekf.P
        if k < m - 1:
            ekf.predict()
            x_ahead[k], P_ahead[k], F[k] = ekf.x, ekf.P, ekf.F
    for k in range(m - 2, -1, -1):
        gain = P[k] @ F[k].T @ np.linalg.inv(P_ahead[k])
        x[k] += gain @ (x[k + 1] - x_ahead[k])
        P[k] += gain @ (P[k + 1] - P_ahead[k]) @ gain.T
    return x, P
