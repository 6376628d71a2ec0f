"""seatrial: from the raw logs of an underwater-glider field trial to a validated flight model."""

__version__ = "0.1.0"
