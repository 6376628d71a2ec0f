"""The methods paragraph, generated from what was run: what was borrowed, how it was done, whose work it rests on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report.compare import floats
from pipeline.report.nominal import ballast_std
from pipeline.report.rounding import signed, uncertainty

if TYPE_CHECKING:
    from pipeline.report import Inputs
    from pipeline.vehicle import Vehicle

#: Works by what names them in the paragraph, or in the sources of a vehicle's coefficients.
WORKS = {
    "ASME V&V 20-2009": (
        "ASME V&V 20-2009. Standard for Verification and Validation in Computational Fluid Dynamics and Heat Transfer."
    ),
    "Belsley et al.": ("Belsley, D. A., Kuh, E., Welsch, R. E. (1980). Regression Diagnostics. doi:10.1002/0471725153"),
    "Eriksen et al.": (
        "Eriksen, C. C. et al. (2001). Seaglider: a long-range autonomous underwater vehicle for oceanographic "
        "research. IEEE J. Ocean. Eng. 26(4), 424–436. doi:10.1109/48.972073"
    ),
    "Maine and Iliff": (
        "Maine, R. E., Iliff, K. W. (1985). Identification of Dynamic Systems: Theory and Formulation. NASA RP-1138."
    ),
    "McDougall and Barker": (
        "McDougall, T. J., Barker, P. M. (2011). Getting started with TEOS-10 and the Gibbs Seawater (GSW) "
        "Oceanographic Toolbox. SCOR/IAPSO WG127."
    ),
    "Merckelbach et al.": (
        "Merckelbach, L., Smeed, D., Griffiths, G. (2010). Vertical water velocities from underwater gliders. J. "
        "Atmos. Oceanic Technol. 27, 547–563. doi:10.1175/2009JTECHO710.1"
    ),
    "Niu et al.": (
        "Niu, W.-D., Wang, S.-X., Wang, Y.-H., Song, Y., Zhu, Y.-Q. (2017). Stability analysis of hybrid-driven "
        "underwater glider. China Ocean Eng. 31(5), 528–538. doi:10.1007/s13344-017-0061-y"
    ),
    "Rauch et al.": (
        "Rauch, H. E., Tung, F., Striebel, C. T. (1965). Maximum likelihood estimates of linear dynamic systems. AIAA "
        "J. 3(8), 1445–1450. doi:10.2514/3.3166"
    ),
    "Schmidt": (
        "Schmidt, S. F. (1966). Application of state-space methods to navigation problems. Advances in Control "
        "Systems 3, 293–340. doi:10.1016/B978-1-4831-6716-9.50011-4"
    ),
}

#: How the ballast is known, by its source.
_BALLAST = {
    "mission.yaml": "Ballast is taken from mission.yaml",
    "logs": "Mass and volume of the hull are taken from the logs' constants",
    "assumed": "Nothing tells the volume of the hull: it is taken as neutral, engine at zero, in the mean density met",
}


def borrowed(inputs: Inputs, *, gps: bool, sensor_used: bool) -> list[str]:
    """Return, one sentence each, what the measured side and the theory took that was not measured here."""
    mission, vehicle = inputs.mission, inputs.vehicle
    out = [
        f"The measured speed and angle of attack of unpowered flight borrow the ratio of lift to drag of "
        f"'{vehicle.name}' – no scale of the coefficients, no buoyancy and no thrust.",
        f"Theory takes all coefficients of the vehicle file, the measured pitch, and the net buoyancy from mass, hull "
        f"volume, engine volume and {'a density that mission.yaml lends' if lent(inputs) else 'the measured density'}.",
    ]
    if vehicle.assumed(vehicle.polar._fields):
        out.append(
            f"Lift and drag of '{vehicle.name}' are assumed, taken from other gliders; their 1σ is in every interval."
        )
    if inputs.blocks["powered"].any():
        other = "GPS displacements or a speed sensor" if gps or sensor_used else "something other than depth"
        out.append(
            "Under propeller thrust is not borrowed for the measured speed either: the ratio only brackets the angle "
            f"of attack, and near level flight the speed is given only where {other} determines it."
        )
    if len(inputs.force):
        out.append(
            "The force estimate takes the same as theory, adjusted to this mission; it is shown beside the measured "
            "side and is never compared with theory."
        )
    correction = mission.pitch
    if correction.scale != 1.0 or correction.offset_rad != 0.0:
        out.append(
            f"Pitch was corrected as mission.yaml says: {correction.scale:g} × logged "
            f"{signed(math.degrees(correction.offset_rad), 2)}°."
        )
    out.append(f"The pitch bias that remains is taken as 0 ± {correction.std_deg:g}°.")
    ballast = inputs.estimate.get("ballast") or {}
    if ballast:
        out.append(f"{_BALLAST[ballast['source']]}, ± {uncertainty(ballast_std(mission, inputs.estimate))} N.")
    if mission.coefficients:
        changed = ", ".join(f"{name} = {value:g}" for name, value in sorted(mission.coefficients.items()))
        out.append(f"mission.yaml overrides coefficients of the vehicle file: {changed}.")
    if sensor_used:
        out.append("The speed sensor was used by the estimator; it is no longer an independent check of it.")
    return out


def paragraph(inputs: Inputs, fitted: Mapping[str, Any], *, gps: bool, sensor_used: bool) -> str:
    """Return the methods in a form that can be pasted into a paper."""
    settings: Mapping[str, Any] = inputs.estimate.get("settings") or {}
    mission = inputs.mission
    water = ""
    if _number(settings.get("sigma_w")) and _number(settings.get("tau_w")):
        water = (
            f" The vertical velocity of the water was a Gauss–Markov process with a standard deviation of "
            f"{100 * settings['sigma_w']:.2f} cm/s and a correlation time of {settings['tau_w']:.0f} s, both found by "
            f"the likelihood of the innovations."
        )
    text = (
        f"Logs of mission {mission.slug} ({inputs.ingest.get('format', 'plain')} format) were analysed with seatrial"
        f"{_version(inputs)}. {_density(inputs)}; depth and pitch were not interpolated. Speed through water and angle "
        f"of attack were estimated by a Kalman filter and smoother (Rauch et al., 1965) on each instrument's own clock "
        f"from depth and pitch, closed by the lift/drag ratio of the vehicle in unpowered steady flight (Merckelbach "
        f"et al., 2010); the errors of that ratio and of pitch were considered (Schmidt, 1966).{water}"
    )
    if gps:
        text += " In level flight under propeller the speed came from GPS fixes at the ends of submerged legs."
    if len(inputs.force):
        told = "the depth rate and the speed sensor" if sensor_used else "the depth rate"
        driven = "thrust" in (inputs.estimate.get("force") or {}).get("parameters", ())
        thrust = "thrust, " if driven else ""
        rest = "adjusted, too" if sensor_used else "considered, as above"
        text += (
            f" A second estimate takes the dynamics of the theory, V̇ along the path and the lift balance across it, "
            f"its drag, net buoyancy, {thrust}compressibility, thermal expansion and water carried in the fairing "
            f"adjusted to {told} by the filter-error method (Maine and Iliff, 1985); lift, induced drag and the bias "
            f"of pitch were {rest}."
        )
    if (inputs.estimate.get("used") or {}).get("pitch_rate"):
        text += " A gyro's rate of pitch moved the pitch from sample to sample; its bias was estimated."
    if sensor_used:
        text += (
            f" The speed sensor entered the estimates, its scale error, {100 * mission.speed_sensor_scale_std:g} % "
            f"before the mission, estimated with the speed."
        )
    text += (
        f" Steady flight was cut into blocks of {mission.block_s:g} s (at least {mission.minimum_block_s:g} s). Steady "
        f"states were computed from Niu et al. (2017), with the errata of their equations corrected, for the vehicle "
        f"'{inputs.vehicle.name}' with the measured pitch held, in moment balance, and at the angle of attack "
        f"−K_M0/K_M. Differences E between theory and measurement are given with the validation uncertainty u_val of "
        f"ASME V&V 20-2009, the covariance from shared coefficients subtracted."
    )
    if fitted["reason"]:
        text += f" No correction was fitted: {fitted['reason']}."
    else:
        names = " and ".join(item["symbol"] for item in fitted["parameters"])
        text += (
            f" {names} were fitted to the mean depth rates of {fitted['blocks']} blocks by generalised least squares "
            f"with the covariance of measurement and moving water; collinearity was judged after Belsley et al. (1980)."
        )
        if any(item["name"] == "thrust_by_voltage" for item in fitted["parameters"]):
            text += (
                " b_U is the relative change of thrust per relative change of the battery's voltage about its mean "
                "under propeller."
            )
        if "displacements between fixes" in fitted["compared_with"]:
            text += (
                " Displacements between GPS fixes on several headings were fitted with them, the current being a "
                "constant and a Gauss–Markov process."
            )
    return text


def lent(inputs: Inputs) -> bool:
    """Return whether the water is that of mission.yaml, no salinity having been measured."""
    return inputs.mission.water is not None and not bool(np.isfinite(floats(inputs.records, "absolute_salinity")).any())


def citations(text: str, vehicle: Vehicle) -> list[str]:
    """Return the works that the paragraph `text` and the sources of the vehicle's coefficients name."""
    named = " ".join((text, vehicle.description, *(item.source for item in vehicle.coefficients.values())))
    return [work for name, work in WORKS.items() if name in named]


def _density(inputs: Inputs) -> str:
    """Return where the density is from, a sentence without its end."""
    water = inputs.mission.water
    if water is None or not lent(inputs):
        return "In-situ density follows from TEOS-10 (McDougall and Barker, 2011) at the measured pressure"
    return (
        f"No conductivity was measured; in-situ density was taken as {water.density:g} kg/m³ at the surface and "
        f"{water.density_per_dbar:g} kg/m³ more per dbar, ± {water.std:g} kg/m³"
    ) + (f" ({water.source})" if water.source else "")


def _version(inputs: Inputs) -> str:
    for stage in (inputs.provenance.get("stages") or {}).values():
        version = (stage.get("software") or {}).get("seatrial")
        if version:
            return f" {version}"
    return ""


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
