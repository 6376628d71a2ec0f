"""Causes: the reasons that the paper names for a difference between theory and measurement, each with one unknown.

A cause is more than what is stated of the vehicle and its instruments: the vehicle file's 1-sigma covers what its
coefficients may be off by, the size of a cause what comes on top when something is wrong. Niu et al. (2017), Section
5, doi:10.1007/s13344-017-0061-y, name the battery's trim, drag of sensors, thrust, buoyancy and turning flight. Thrust
that follows the battery's voltage does so with an exponent from 0 to 2 (see `parameters.VOLTAGE_STD`), 1 ± 0.6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.report.fitting.parameters import Correction
from pipeline.vehicle import Vehicle

#: A cause is at least this many times what is stated already: what the stated 1-sigma covers is no cause.
BEYOND = 3.0
#: What sensors on the hull or growth add to its drag, as a share.
DRAG = 0.3

#: The share κ of the loss of lift, a factor cos φ, that the measured roll φ predicts; what it weighs is the vehicle's.
TURNING = Correction(
    "κ", "1", "share of the loss of lift that the measured roll predicts", "lift_slope", lambda p: np.zeros(p.size), 1.0
)


@dataclass(frozen=True)
class Cause:
    """A reason that can be put to the test.

    Attributes
    ----------
    name, words
        For a script, and as a sentence begins.
    unknown
        Name of the correction that the cause makes.
    size
        1-sigma of the change when the cause is there, in the correction's unit, or as a share of the coefficient.
    relative
        Whether `size` is a share.
    expected
        Mean of the correction when the cause is there.
    """

    name: str
    words: str
    unknown: str
    size: float
    relative: bool = False
    expected: float = 0.0

    def spread(self, vehicle: Vehicle, stated: float) -> float:
        """Return the 1-sigma of the change, given the `stated` 1-sigma of the correction, in its unit."""
        size = self.size * abs(vehicle[self.unknown]) if self.relative else self.size
        return max(size, BEYOND * stated)


CAUSES = (
    Cause("battery trim", "Battery trim", "battery_neutral_position", 0.01),
    Cause("sensor drag", "Sensor drag", "parasite_drag", DRAG, relative=True),
    Cause("thrust loss", "Loss of thrust", "thrust_scale", 0.3),
    Cause("battery voltage", "Thrust that follows the battery's voltage", "thrust_by_voltage", 0.6, expected=1.0),
    Cause("buoyancy error", "An error of buoyancy", "net_buoyancy", 0.5),
    Cause("pitch bias", "A bias of pitch", "pitch", math.radians(1.5)),
    Cause("turning flight", "Turning flight", "turning", 0.3, expected=1.0),
    Cause("water motion", "Motion of the water", "water", 0.02),
)
