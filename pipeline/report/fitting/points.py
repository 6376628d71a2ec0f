"""Blocks as plain arrays: what the theory is asked at, and what was measured there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.model.case import driven
from pipeline.records import seconds
from pipeline.report.compare import density_of, floats
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]

DAY = 86400.0


class Configuration(NamedTuple):
    """What the vehicle carried from one dive to another, both included."""

    name: str
    first: int
    last: int


@dataclass(frozen=True)
class Points:
    """Means of n blocks in time order, each of shape (n,); NaN where not measured.

    Attributes
    ----------
    block, dive, direction
        Numbers of block and dive; -1 down, +1 up, 0 level.
    start, end, days
        Bounds, s since 1970; middle since the first block of the mission, days.
    powered, propeller_speed, propeller_power
        Whether the propeller turns; rev/s and W that thrust follows from, see `model.case.driven`.
    relative_voltage
        Battery voltage less its mean of the powered blocks, over that mean (0 where unknown).
    net_buoyancy, by_compression, by_expansion, by_lag, by_carried, by_flushing
        G, N; its change per compressibility, N Pa, per thermal expansion, N K, per time constant of the hull's
        temperature, N/s, per share of the hull's volume that a fairing carries, N, and per time in which that water is
        renewed, N/s (0 where unknown).
    pitch, heading, roll, density, depth, battery_position, battery_position_std
        rad, rad, rad, kg/m³, m, m, m.
    depth_rate, depth_rate_std, sensor_speed, sensor_speed_std
        Measured, m/s.
    configuration
        Index into `configurations`, 0 for a dive in none.
    configurations
        Names of the sensor configurations, that of reference first.
    """

    block: NDArray[np.int64]
    dive: NDArray[np.int64]
    direction: NDArray[np.int64]
    start: Array
    end: Array
    days: Array
    powered: NDArray[np.bool_]
    propeller_speed: Array
    propeller_power: Array
    relative_voltage: Array
    net_buoyancy: Array
    by_compression: Array
    by_expansion: Array
    by_lag: Array
    by_carried: Array
    by_flushing: Array
    pitch: Array
    heading: Array
    roll: Array
    density: Array
    depth: Array
    battery_position: Array
    battery_position_std: Array
    depth_rate: Array
    depth_rate_std: Array
    sensor_speed: Array
    sensor_speed_std: Array
    configuration: NDArray[np.int64]
    configurations: tuple[str, ...] = ()

    @classmethod
    def of(cls, blocks: pd.DataFrame, vehicle: Vehicle, configurations: Sequence[Configuration] = ()) -> Points:
        """Return the rows of `blocks`, table `records.BLOCKS`, in time order."""
        begin = seconds(blocks["start"])
        order = np.argsort(begin, kind="stable")
        start, end = begin[order], seconds(blocks["end"])[order]

        def column(name: str) -> Array:
            return floats(blocks, name)[order]

        dive = blocks["dive"].to_numpy(dtype=np.int64)[order]
        configuration = np.zeros(dive.size, dtype=np.int64)
        for number, item in enumerate(configurations):
            configuration[(dive >= item.first) & (dive <= item.last)] = number
        middle = 0.5 * (start + end)
        powered = blocks["powered"].to_numpy(dtype=bool)[order]
        propeller_speed, propeller_power = driven(
            vehicle, powered, column("propeller_speed"), column("propeller_power")
        )
        plain = ("net_buoyancy", "pitch", "heading", "roll", "depth", "battery_position", "battery_position_std")
        by = ("by_compression", "by_expansion", "by_lag", "by_carried", "by_flushing")
        measured = ("depth_rate", "depth_rate_std", "sensor_speed", "sensor_speed_std")
        return cls(
            block=blocks["block"].to_numpy(dtype=np.int64)[order],
            dive=dive,
            direction=blocks["direction"].to_numpy(dtype=np.int64)[order],
            start=start,
            end=end,
            days=(middle - middle[0]) / DAY if dive.size else middle,
            powered=powered,
            propeller_speed=propeller_speed,
            propeller_power=propeller_power,
            relative_voltage=_relative(column("battery_voltage"), powered),
            density=density_of(blocks, vehicle)[order],
            configuration=configuration,
            configurations=tuple(item.name for item in configurations),
            **{name: column(name) for name in (*plain, *measured)},
            **{name: np.nan_to_num(column(f"buoyancy_{name}")) for name in by},
        )

    @property
    def size(self) -> int:
        """Number of blocks n."""
        return self.dive.size

    def only(self, chosen: NDArray[Any]) -> Points:
        """Return the blocks `chosen` by a mask or by indices."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "configurations"}
        return replace(self, **{name: array[chosen] for name, array in arrays.items()})


def _relative(voltage: Array, powered: NDArray[np.bool_]) -> Array:
    """Return `voltage` over its mean where `powered`, less one, shape (n,); 0 where it is not known."""
    known = voltage[powered & np.isfinite(voltage)]
    return np.nan_to_num(voltage / known.mean() - 1.0) if known.size else np.zeros_like(voltage)
