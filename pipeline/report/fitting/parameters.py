"""The corrections that can be fitted: symbol, unit, meaning, and how well each was known before."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from pipeline.vehicle import Vehicle

#: Corrections that are added to a coefficient of the vehicle.
COEFFICIENTS = ("parasite_drag", "lift_at_zero", "lift_slope", "induced_drag")


@dataclass(frozen=True)
class Quantity:
    """A correction: symbol, unit and what it means to a reader."""

    symbol: str
    unit: str
    meaning: str


CORRECTIONS = {
    "parasite_drag": Quantity("ΔK_D0", "kg/m", "drag at zero angle of attack, as of sensors on the hull"),
    "net_buoyancy": Quantity("ΔG", "N", "constant part of net buoyancy, ballast"),
    "lift_at_zero": Quantity("ΔK_L0", "kg/m", "lift at zero angle of attack"),
    "lift_slope": Quantity("ΔK_L", "kg/m/rad", "lift per angle of attack"),
    "induced_drag": Quantity("ΔK_D", "kg/m/rad2", "drag per squared angle of attack"),
    "thrust_scale": Quantity("Δscale_T", "1", "thrust, relative"),
    "pitch": Quantity("Δθ", "rad", "pitch bias"),
}


def prior_stds(vehicle: Vehicle, blocks: pd.DataFrame, ballast_std: float, pitch_std: float) -> dict[str, float]:
    """Return the prior 1-sigma of every correction that these blocks feel; NaN where the vehicle file has none."""
    out = {name: vehicle.std(name) for name in COEFFICIENTS}
    static = vehicle["thrust_static"]
    if len(blocks) and blocks["powered"].any() and static:
        out["thrust_scale"] = abs(vehicle.std("thrust_static") / static)
    return out | {"net_buoyancy": ballast_std, "pitch": pitch_std}
