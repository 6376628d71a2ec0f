"""Real missions with measured truth: how they are run and how they are scored. Shared by benchmarks and tests."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.records import seconds

#: Folder below the data folder, files taken, and mission.yaml of each real mission.
MISSIONS: dict[str, tuple[str, str, str]] = {
    "comet": (
        "slocum/comet2016/raw",
        "*",
        "vehicle: slocum-g2\nlatitude: 54.75\nlongitude: 15.1\nsalinity: baltic\n"
        "pitch: {scale: 0.86, offset_rad: -0.004}\nballast: {mass: 70, neutral_density: 1004}\n",
    ),
    "sg171": ("seaglider/sg171_ekamsat2024", "p*.nc", "vehicle: seaglider\n"),
    "amadeus": ("slocum/misc", "amadeus*", "vehicle: slocum-g2\n"),
    "sg249": ("seaglider/sg249_nanoos2024", "p*.nc", "vehicle: seaglider-sgx\n"),
    "sg542": ("seaglider/sg542", "p*.nc", "vehicle: seaglider\n"),
}


def lay_out(data: Path, raw: Path, names: tuple[str, ...] = tuple(MISSIONS)) -> None:
    """Copy the logs of real missions into folders under `raw`, with a mission.yaml of a few lines each."""
    for name in names:
        source, pattern, text = MISSIONS[name]
        folder = raw / name
        folder.mkdir(parents=True)
        for file in sorted((data / source).glob(pattern)):
            if file.is_file():
                shutil.copyfile(file, folder / file.name)
        if name == "amadeus":
            shutil.copytree(data / source / "cac", folder / "cac", copy_function=shutil.copyfile)
        (folder / "mission.yaml").write_text(text, encoding="utf-8")


def score_comet(data: Path, estimates: pd.DataFrame, shallow: float, deep: float) -> dict[str, float]:
    """Compare the kinematic speed with comet's DVL, native samples, between two pressures in dbar.

    As the data's own notes say: dives only (depth increasing, U > 0.1 m/s), the first yo left out, samples more than
    5 cm/s from their running median of 15 left out. Returned: n, bias and rmse [m/s], coverage of the 95 % interval
    with 0.6 cm/s for the DVL.
    """
    time, speed = np.load(data / "slocum/comet2016/U_kalman_native.npy")
    clock, bar, *_ = np.load(data / "slocum/comet2016/flight_P_pitch_vb_rho_U.npy")
    pressure = 10.0 * np.interp(time, clock, bar)
    smooth = pd.Series(10.0 * bar).rolling(15, center=True, min_periods=1).mean().to_numpy()
    sinking = np.interp(time, clock, np.gradient(smooth, clock)) > 0.0
    flying = speed > 0.1
    median = pd.Series(np.where(flying, speed, np.nan)).rolling(15, center=True, min_periods=1).median().to_numpy()
    below = np.flatnonzero(10.0 * bar > 30.0)[0]
    first_yo_ends = clock[below + np.flatnonzero(10.0 * bar[below:] < 8.0)[0]]
    chosen = flying & sinking & (time > first_yo_ends) & (pressure >= shallow) & (pressure <= deep)
    chosen &= np.abs(speed - np.where(np.isnan(median), 0.0, median)) < 0.05
    found = estimates[estimates["observable"]]
    at = seconds(found["time"])
    nearest = np.clip(np.searchsorted(at, time[chosen]), 1, at.size - 1)
    chosen_times = time[chosen]
    nearest -= chosen_times - at[nearest - 1] < at[nearest] - chosen_times
    close = np.abs(at[nearest] - chosen_times) < 10.0
    gap = found["speed"].to_numpy()[nearest][close] - speed[chosen][close]
    sigma = np.hypot(found["speed_std"].to_numpy()[nearest][close], 0.006)
    return {
        "samples": float(chosen.sum()),
        "n": float(gap.size),
        "bias": float(gap.mean()),
        "rmse": float(np.sqrt(np.mean(gap**2))),
        "coverage": float(np.mean(np.abs(gap) < 1.96 * sigma)),
    }


def score_sg171(data: Path, estimates: pd.DataFrame) -> dict[str, float]:
    """Compare the kinematic speed, averaged over the same 60 s, with the AD2CP's good ensembles; the stored one too."""
    truth = pd.read_csv(data / "seaglider/sg171_ekamsat2024/truth_adcp.csv")
    truth = truth[truth["ok"] == 1]
    found = estimates[estimates["observable"]]
    at, speed, std = (seconds(found["time"]), found["speed"].to_numpy(), found["speed_std"].to_numpy())
    gaps, sigmas, stored = [], [], []
    for time, value, model in truth[["time_unix_s", "V_ttw_m_s", "model_speed_m_s"]].to_numpy():
        inside = np.abs(at - time) <= 30.0
        stored.append(model - value)
        if inside.any():
            gaps.append(speed[inside].mean() - value)
            sigmas.append(np.hypot(std[inside].mean(), 0.01))
    gap, sigma = np.array(gaps), np.array(sigmas)
    return {
        "ensembles": float(len(truth)),
        "n": float(gap.size),
        "bias": float(gap.mean()),
        "rmse": float(np.sqrt(np.mean(gap**2))),
        "coverage": float(np.mean(np.abs(gap) < 1.96 * sigma)),
        "stored_bias": float(np.nanmean(stored)),
        "stored_rmse": float(np.sqrt(np.nanmean(np.square(stored)))),
    }
