"""Logs: what every reader returns, each instrument still on its own clock."""

from __future__ import annotations

from dataclasses import dataclass, field

import pandas as pd

from pipeline.findings import Finding


@dataclass(frozen=True)
class Logs:
    """The logs of one mission, in SI and radians, before they meet in one table.

    Attributes
    ----------
    streams
        One frame per instrument clock: ``time`` [s since 1970-01-01 UTC], then columns named as in
        `pipeline.records.MEASURED` (and ``speed_through_water_std``), values as written, NaN where the instrument
        did not report, each with an optional companion ``<name>_qc`` (OG1 flags). Nothing is interpolated.
    findings
        What was skipped, clipped or doubted while reading.
    constants
        Calibration constants kept in the logs; for Seaglider ``hd_a hd_b hd_c hd_s glider_length [m] mass [kg]
        abs_compress [1/dbar] therm_expan [1/K] temp_ref [degC] rho0 [kg/m3] hull_volume [m3]``.
    stored
        Flight solution that the vehicle's own software had stored: ``time`` [s], ``speed`` and ``vertical_speed``
        [m/s, up positive]; None where there is none.
    """

    streams: list[pd.DataFrame]
    findings: list[Finding] = field(default_factory=list)
    constants: dict[str, float] = field(default_factory=dict)
    stored: pd.DataFrame | None = None
