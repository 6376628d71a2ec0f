"""Trials: the three field trials of Niu et al. (2017, Section 5) as plans to be simulated.

The paper (doi:10.1007/s13344-017-0061-y) publishes depths, pitch, net buoyancy and propeller speed of its trials,
but neither the water nor the engine's volumes nor, for the gliding trial, pitch and net buoyancy. What is added here
is ordinary for the place and the season, and said so in each description. In the profiles chosen the vehicle's hull
yields to pressure and cold nearly as the water does: below 120 m net buoyancy stays within 1 N of its nominal value.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.findings import InputError, nearest
from pipeline.mission import Nominal
from pipeline.plan import Plan, Stage, Water
from pipeline.vehicle import load

PAPER = "Niu et al. 2017, Section 5"


def _gliding() -> Plan:
    """South China Sea 2014: gliding to 975 m, six dives and climbs of the 219 profiles."""
    stages: list[Stage] = []
    for heading in (60.0, 120.0, 240.0, 300.0, 60.0, 240.0):
        stages += [
            Stage(-30.0, 5.0, heading, "duration", 420.0, afloat=True),
            Stage(-30.0, -5.0, heading, "deeper", 965.0),
            Stage(30.0, 5.0, heading, "surface"),
        ]
    stages.append(Stage(-30.0, 5.0, 240.0, "duration", 420.0, afloat=True))
    row = {"source": f"{PAPER}: depth only; net buoyancy and pitch are not published, ordinary ones are used"}
    return Plan(
        name="petrel2-scs-2014",
        description=(
            "Gliding trial of Petrel-II, northern South China Sea, March and April 2014: six dives and six climbs of "
            "the 219 profiles to 975 m, by the buoyancy engine alone. The paper gives neither net buoyancy nor pitch: "
            "-5 N and +5 N at 500 m, -30 and +30 degrees are assumed, and so is the water."
        ),
        vehicle=load("petrel-ii"),
        latitude=18.2,
        longitude=116.0,
        start=1395903600.0,
        water=Water(
            depth=(0.0, 50.0, 100.0, 150.0, 200.0, 300.0, 400.0, 500.0, 700.0, 1000.0, 1100.0),
            temperature=(25.0, 24.5, 20.5, 17.3, 14.9, 11.8, 9.7, 8.4, 6.3, 4.4, 4.0),
            salinity=(33.90, 34.10, 34.50, 34.60, 34.57, 34.45, 34.41, 34.41, 34.45, 34.53, 34.55),
        ),
        nominal_depth=500.0,
        stages=tuple(stages),
        nominal=(
            Nominal(name="dive", net_buoyancy=-5.0, pitch_deg=-30.0, direction="down", powered=False, **row),
            Nominal(name="climb", net_buoyancy=5.0, pitch_deg=30.0, direction="up", powered=False, **row),
        ),
        current_east=-0.08,
        current_north=0.12,
        current_std=0.05,
        current_time=21600.0,
        ctd_s=4.0,
    )


#: Fixed-depth trial: held stretches end above the first and corrections below the second depth, m; propeller speed
#: of the corrections, 1/min, at which the mean speed of a leg is that of its held stretches within 0.5 %.
BAND = (7.0, 11.8)
CORRECTION_RPM = 920.0


def _fixed_depth() -> Plan:
    """Danjiangkou Reservoir 2014: along 10 m depth under propeller, out and back between surfacings."""
    stages: list[Stage] = []
    for leg in range(8):
        heading = 90.0 if leg % 2 == 0 else 270.0
        stages += [
            Stage(-15.0, 2.5, heading, "duration", 240.0, afloat=True),
            Stage(-15.0, -2.5, heading, "deeper", 8.0, rpm=780.0),
        ]
        for _ in range(6):
            stages += [
                Stage(-18.0, 2.5, heading, "deeper", BAND[1], rpm=CORRECTION_RPM),
                Stage(3.5, 2.5, heading, "shallower", BAND[0], rpm=780.0),
            ]
        stages.append(Stage(15.0, 2.5, heading, "surface", rpm=780.0))
    stages.append(Stage(-15.0, 2.5, 270.0, "duration", 240.0, afloat=True))
    return Plan(
        name="petrel2-danjiangkou-2014",
        description=(
            "Fixed-depth trial of Petrel-II under propeller, Danjiangkou Reservoir, July 2014: 10 m, net buoyancy "
            "+2.5 N, 780 rpm, pitch held at the measured 3.5 degrees. So trimmed the vehicle climbs at 0.05 m/s: it is "
            "let rise through the depth band and put back by short nose-down corrections at "
            f"{CORRECTION_RPM:g} rpm, which keep up the mean speed. Legs out and back between surfacings, so that the "
            "current cancels. The water is assumed."
        ),
        vehicle=load("petrel-ii"),
        latitude=32.72,
        longitude=111.55,
        start=1406509200.0,
        water=Water(
            depth=(0.0, 4.0, 8.0, 14.0, 20.0, 30.0),
            temperature=(28.4, 27.8, 27.5, 27.2, 25.0, 18.0),
            salinity=(0.12, 0.12, 0.12, 0.12, 0.12, 0.12),
            fresh=True,
        ),
        nominal_depth=10.0,
        stages=tuple(stages),
        nominal=(
            Nominal(
                name="fixed depth 10 m",
                net_buoyancy=2.5,
                propeller_speed_rpm=780.0,
                pitch_deg=3.5,
                published_speed=0.62,
                published_theory_speed=0.7979,
                published_theory_pitch_deg=76.91,
                powered=True,
                source=f"{PAPER}; its theory is for 800 rpm",
            ),
        ),
        vertical_water_std=0.003,
        current_east=0.10,
        current_north=0.03,
        current_std=0.015,
        pump_rate=2e-5,
        battery_rate=5e-3,
        pitch_slew_deg=2.5,
        pitch_deadband_deg=0.05,
        gain_proportional=0.2,
        gain_integral=0.02,
        attitude_s=2.0,
        engine_s=4.0,
        gps_s=5.0,
        gps_delay_s=20.0,
        minimum_block_s=30.0,
    )


def _powered_climbs() -> Plan:
    """South China Sea 2015: gliding dives to 500 m, climbs under propeller."""
    stages: list[Stage] = []
    for heading in (45.0, 135.0, 225.0, 315.0, 45.0):
        stages += [
            Stage(-45.0, 7.0, heading, "duration", 360.0, afloat=True),
            Stage(-45.0, -7.0, heading, "deeper", 485.0),
            Stage(43.5, 7.0, heading, "duration", 90.0),
            Stage(43.5, 7.0, heading, "surface", rpm=1400.0),
        ]
    stages.append(Stage(-45.0, 7.0, 45.0, "duration", 360.0, afloat=True))
    return Plan(
        name="petrel2-scs-2015",
        description=(
            "Hybrid trial of Petrel-II in the South China Sea, February 2015: unpowered dives to 500 m at -7 N and -45 "
            "degrees, climbs at +7 N with the propeller at 1400 rpm. The target pitch of the climbs was +45 degrees; "
            "the measured average, 43.5, is what is held here. The net buoyancies hold at 250 m; the water is assumed."
        ),
        vehicle=load("petrel-ii"),
        latitude=18.0,
        longitude=112.5,
        start=1423623600.0,
        water=Water(
            depth=(0.0, 60.0, 100.0, 150.0, 200.0, 300.0, 400.0, 500.0, 600.0),
            temperature=(23.6, 23.2, 20.2, 16.9, 14.6, 11.6, 9.6, 8.4, 7.3),
            salinity=(34.00, 34.10, 34.50, 34.60, 34.57, 34.46, 34.41, 34.41, 34.43),
        ),
        nominal_depth=250.0,
        stages=tuple(stages),
        nominal=(
            Nominal(
                name="climb under propeller",
                net_buoyancy=7.0,
                propeller_speed_rpm=1400.0,
                pitch_deg=43.5,
                published_speed=1.2,
                published_theory_speed=1.3743,
                published_theory_pitch_deg=76.14,
                direction="up",
                powered=True,
                source=PAPER,
            ),
            Nominal(
                name="dive",
                net_buoyancy=-7.0,
                pitch_deg=-45.0,
                direction="down",
                powered=False,
                source=f"{PAPER}; target pitch, speed not published",
            ),
        ),
        current_east=0.06,
        current_north=-0.09,
        current_std=0.04,
        current_time=21600.0,
        pump_rate=1.2e-5,
        battery_rate=4e-3,
        pitch_slew_deg=0.8,
        pitch_deadband_deg=0.1,
        engine_s=4.0,
    )


TRIALS: dict[str, Callable[[], Plan]] = {
    "petrel2-scs-2014": _gliding,
    "petrel2-danjiangkou-2014": _fixed_depth,
    "petrel2-scs-2015": _powered_climbs,
}


def trial(name: str) -> Plan:
    """Return the plan of the trial `name`.

    Raises
    ------
    InputError
        If there is no such trial; the nearest is named.
    """
    if name not in TRIALS:
        raise InputError(
            "simulate", "trial", found=f"'{name}'", expected="a known trial", remedy=nearest(name, list(TRIALS))
        )
    return TRIALS[name]()
