"""Logs: what every reader returns, each instrument still on its own clock."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

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
        did not report, each with an optional companion ``<name>_qc`` (OG1 flags). Nothing is interpolated, with one
        exception that is no measurement: a CTD without a pressure sensor of its own may bring
        ``pressure_interpolated`` [dbar], the pressure at its instants as another sensor's clock gives it. It serves
        absolute salinity and density at those instants, never depth, and has no place in the records.
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


class UnreadableError(Exception):
    """A file that cannot be read: what was found in it, what was expected, what to do."""

    def __init__(self, found: str, expected: str = "", remedy: str = "left out; copy the file again") -> None:
        self.found, self.expected, self.remedy = found, expected, remedy
        super().__init__(found)


def of_one(folder: str, gliders: set[str]) -> list[Finding]:
    """Return a warning where the files of a mission are of more than one glider, by what their names say."""
    if len(gliders) < 2:
        return []
    found = f"files of gliders named {', '.join(sorted(gliders))}"
    remedy = "if these are not names of one vehicle, give each a folder of its own"
    return [Finding("warning", folder, "", found, "one", remedy)]


def gather(findings: Iterable[Finding]) -> list[Finding]:
    """Return `findings` with those that differ by their file alone made one, which names the first file."""
    groups: dict[Finding, list[str]] = {}
    for finding in findings:
        groups.setdefault(replace(finding, file=""), []).append(finding.file)
    out = []
    for finding, names in groups.items():
        more = len(names) - 1
        where = finding.where if not more else f"and {more} more file{'s' if more > 1 else ''}"
        out.append(replace(finding, file=names[0], where=where))
    return out
