"""Real missions with measured truth: how they are run and how they are scored. Shared by benchmarks and tests."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline import mission as missions
from pipeline.conventions import from_seaglider
from pipeline.estimate import adjust, preparation, stage
from pipeline.estimate.ballast import hull
from pipeline.estimate.stage import Estimated, estimate
from pipeline.ingest import ingest
from pipeline.mission import Mission
from pipeline.records import RECORDS, Quality, conform, of_method, seconds, timestamps
from pipeline.roster import resolve_vehicle
from pipeline.vehicle import Vehicle

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
    "maria": ("slocum/maria997", "*", "vehicle: slocum-deep\n"),
    "sea063": ("seaexplorer/sea063_ad2cp", "*.gz", "vehicle: seaexplorer\n"),
    "sg249": ("seaglider/sg249_nanoos2024", "p*.nc", "vehicle: seaglider-sgx\n"),
    "sg542": ("seaglider/sg542", "p*.nc", "vehicle: seaglider\n"),
    "sg167": ("seaglider/sg167", "p*.nc", "vehicle: seaglider\n"),
    "sg561": ("seaglider/sg561_lofoten2016", "p*.nc", "vehicle: seaglider\n"),
    "kolumbo": (
        "slocum/kolumbo2019_hybrid",
        "glider_data.csv",
        "vehicle: slocum-thruster\nlatitude: 36.5\nlongitude: 25.5\n"
        "water: {density: 1028.9, density_per_dbar: 0.0045, std: 0.5, temperature: 17, temperature_per_dbar: -0.005, "
        "source: 'upper Aegean in winter, order of'}\n"
        "files: {glider_data.csv: {columns: {depth: {column: z, unit: m}, pitch: {column: pitch, unit: deg}, "
        "roll: {column: roll, unit: deg}, buoyancy_volume: {column: pump_vol, unit: cc}, "
        "propeller_power: {column: mot_pwr, unit: W}}, ignore: [lat, lon, yaw]}}\n",
    ),
}

#: Random error of comet's DVL, m/s.
DVL_STD = 0.006


#: Ranges of pressure, dbar, that comet is scored in.
DEPTHS = ((12.0, 35.0, "12-35 dbar"), (12.0, 1e4, ">= 12 dbar"))


def asked(offered: tuple[str, ...]) -> tuple[Path, tuple[str, ...]] | None:
    """Return the folder of real logs and the missions that the command line names; None, and a line, if there is none.

    Parameters
    ----------
    offered
        The missions meant where none is named, of `MISSIONS`.
    """
    given = sys.argv[1:]
    where = given[0] if given else os.environ.get("SEATRIAL_DATA")
    if not where or not Path(where).is_dir():
        print("real logs: found no folder; expected one as argument or in SEATRIAL_DATA", file=sys.stderr)
        return None
    unknown = [name for name in given[1:] if name not in MISSIONS]
    if unknown:
        print(f"mission: found '{unknown[0]}'; expected one of {', '.join(offered)}", file=sys.stderr)
        return None
    return Path(where), tuple(given[1:]) or offered


def lay_out(data: Path, raw: Path, names: tuple[str, ...] = tuple(MISSIONS)) -> None:
    """Copy the logs of real missions into folders under `raw`, with a mission.yaml of a few lines each."""
    for name in names:
        source, pattern, text = MISSIONS[name]
        folder = raw / name
        folder.mkdir(parents=True)
        for file in sorted((data / source).glob(pattern)):
            if file.is_file():
                shutil.copyfile(file, folder / file.name)
        if (data / source / "cac").is_dir():
            shutil.copytree(data / source / "cac", folder / "cac", copy_function=shutil.copyfile)
        (folder / "mission.yaml").write_text(text, encoding="utf-8")


class Real(NamedTuple):
    """A real mission, ingested.

    Attributes
    ----------
    mission, vehicle, records, constants
        As stage 2 is given them.
    """

    mission: Mission
    vehicle: Vehicle
    records: pd.DataFrame
    constants: Mapping[str, float]


def read(name: str, data: Path, raw: Path) -> Real:
    """Return a real mission, laid out under `raw` and ingested."""
    lay_out(data, raw, (name,))
    mission = missions.load(raw / name)
    found = ingest(mission)
    return Real(mission, resolve_vehicle(mission, found.constants), found.records, found.constants)


def estimated(real: Real) -> Estimated:
    """Return what stage 2 makes of a real mission."""
    return estimate(real.records, real.vehicle, real.mission, constants=real.constants)


def by_unadjusted_force(real: Real, vehicle: Vehicle) -> pd.DataFrame:
    """Return the estimates by the force model of `vehicle`, none of its parameters adjusted."""
    body = hull(real.mission, vehicle, real.constants, real.records)
    prepared = preparation.prepare([real.records], vehicle, real.mission, body)
    if prepared.adjusted is None:
        raise ValueError(f"force model: {prepared.reason}")
    prepared = prepared._replace(adjusted=adjust.unadjusted(prepared.adjusted))
    tables = [table for part in stage.solved([real.records], prepared) for table in part.estimates]
    return of_method(pd.concat(tables), "force")


def with_stored_polar(real: Real) -> Vehicle:
    """Return the vehicle of a Seaglider mission with the lift and drag that its own files keep."""
    return from_seaglider(real.vehicle, real.constants, source="the logs")


def with_dvl(real: Real, data: Path) -> Real:
    """Return comet's mission with its DVL at the sensor's own instants, to be used by the estimator.

    The DVL is not in the raw logs. Its samples are rows of their own; ~0 is its word for no estimate.
    """
    time, speed = np.load(data / "slocum/comet2016/U_kalman_native.npy")
    given = speed > 0.1
    rows = pd.DataFrame(
        {
            "time": timestamps(time[given]),
            "speed_through_water": speed[given],
            "speed_through_water_std": DVL_STD,
            "speed_through_water_qc": np.int8(Quality.NONE),
        }
    )
    rows = rows[~rows["time"].isin(real.records["time"])]
    table = conform(pd.concat([real.records, conform(rows, RECORDS)], ignore_index=True), RECORDS)
    own = np.arange(len(table)) < len(real.records)
    order = np.argsort(table["time"].to_numpy(), kind="stable")
    table, own = table.iloc[order].reset_index(drop=True), own[order]
    for name in ("phase", "dive", "block"):
        table[name] = table[name].where(own).ffill().bfill().astype(table[name].dtype)
    return real._replace(records=table, mission=real.mission.model_copy(update={"speed_sensor": "use"}))


def score_comet(data: Path, estimates: pd.DataFrame, shallow: float, deep: float) -> dict[str, float]:
    """Compare the speed of one method with comet's DVL, native samples, between two pressures in dbar.

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
    sigma = np.hypot(found["speed_std"].to_numpy()[nearest][close], DVL_STD)
    return {
        "samples": float(chosen.sum()),
        "n": float(gap.size),
        "bias": float(gap.mean()),
        "rmse": float(np.sqrt(np.mean(gap**2))),
        "coverage": float(np.mean(np.abs(gap) < 1.96 * sigma)),
    }


def score_sg171(data: Path, estimates: pd.DataFrame) -> dict[str, float]:
    """Compare the speed of one method, averaged over the same 60 s, with the AD2CP's good ensembles; so the stored."""
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
        "samples": float(len(truth)),
        "n": float(gap.size),
        "bias": float(gap.mean()),
        "rmse": float(np.sqrt(np.mean(gap**2))),
        "coverage": float(np.mean(np.abs(gap) < 1.96 * sigma)),
        "stored_bias": float(np.nanmean(stored)),
        "stored_rmse": float(np.sqrt(np.nanmean(np.square(stored)))),
    }


def in_words(score: dict[str, float]) -> str:
    """Return a score in words."""
    return (
        f"RMSE {100 * score['rmse']:.2f} cm/s, bias {100 * score['bias']:+.2f} cm/s, 95 % interval covers "
        f"{100 * score['coverage']:.0f} % ({score['n']:.0f} of {score['samples']:.0f} observable)"
    )


def water_rms(estimates: pd.DataFrame, records: pd.DataFrame) -> dict[str, float]:
    """Return what one method says of the water's vertical velocity in steady flight, m/s.

    ``rms`` is the standard deviation of the smoothed velocity; smoothing makes it too small where little is known, so
    ``with_std`` adds the variance that the estimate claims for itself.
    """
    steady = (records["block"].to_numpy() >= 0) & estimates["observable"].to_numpy(dtype=bool)
    water = estimates["vertical_water_velocity"].to_numpy()[steady]
    std = estimates["vertical_water_velocity_std"].to_numpy()[steady]
    return {"rms": float(np.std(water)), "with_std": float(np.sqrt(np.var(water) + np.mean(std**2)))}
