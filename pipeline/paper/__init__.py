"""The paper that the theory is from, computed again: every table, figure and number of Niu et al. (2017).

Source: China Ocean Eng. 31(5), 528-538, doi:10.1007/s13344-017-0061-y.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import __version__, store
from pipeline.paper.claim import TOLERANCE, Claim
from pipeline.paper.composite import certificate, composite
from pipeline.paper.derived import derived
from pipeline.paper.errata import ERRATA
from pipeline.paper.figures import figures
from pipeline.paper.numbers import TABLE_2, coefficients, curves, example, propeller, trials
from pipeline.paper.region import figure, ordering, regions
from pipeline.paper.trials import TRIALS, compared, remainder
from pipeline.report.page import environment
from pipeline.vehicle import Vehicle, load

PAGE, NUMBERS = "paper.html", "paper.json"
VERDICTS = ("reproduced", "misprint", "not reproducible", "used as printed", "set or measured")

#: Table 1: property, Slocum AUV, Folaga-III, Petrel-II.
TABLE_1 = (
    ("Diameter (mm)", "220", "140", "221"),
    ("Mass (kg)", "56", "30", "70"),
    ("Design depth (m)", "1000", "100", "1500"),
    ("Advance rate (m/s)", "1.00", "1.01", "1.50"),
    ("Length, without antenna (m)", "1.5", "2.0", "2.3"),
    ("Battery power (MJ)", "36.70", "3.11", "18.9"),
    ("Voyage (km)", "1500–6000", "–", "1500"),
)


def claims(vehicle: Vehicle) -> list[Claim]:
    """Return every printed number of Sections 2 to 5 in the order of the paper, beside the computed ones."""
    parts = (propeller, coefficients, curves, example, composite, trials)
    return [claim for part in parts for claim in part(vehicle)]


def content(vehicle: Vehicle) -> dict[str, Any]:
    """Return what paper.json holds; NaN where there is no such number.

    Parameters
    ----------
    vehicle
        Petrel-II.
    """
    rows = [claim.row() for claim in claims(vehicle)]
    certified = regions(vehicle)
    return {
        "paper": "Niu et al. 2017, China Ocean Eng. 31(5), 528-538, doi:10.1007/s13344-017-0061-y",
        "seatrial": __version__,
        "vehicle": vehicle.name,
        "tolerance": TOLERANCE,
        "verdicts": {verdict: Counter(row["verdict"] for row in rows)[verdict] for verdict in VERDICTS},
        "numbers": rows,
        "derived": derived(vehicle),
        "certificate": certificate(vehicle),
        "regions": certified,
        "ordering": ordering(certified),
        "trials": [compared(vehicle, trial) for trial in TRIALS],
        "remainder": remainder(vehicle),
        "table_1": [list(row) for row in TABLE_1],
        "table_2": _table_2(vehicle),
        "errata": [erratum._asdict() for erratum in ERRATA],
    }


def write(out: Path) -> dict[str, Any]:
    """Write ``paper.html`` and ``paper.json`` into the folder `out`, and return the content of the latter.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    vehicle = load("petrel-ii")
    found: dict[str, Any] = store.plain(content(vehicle))
    page = (
        environment()
        .get_template("paper.html")
        .render(
            paper=found,
            pictures={**figures(vehicle), "fig10": figure(vehicle)},
            no_figure={},
            guide={"sections": {}, "figures": {}},
            verdicts=VERDICTS,
        )
    )
    out.mkdir(parents=True, exist_ok=True)
    store.write_json(out / NUMBERS, found)
    store.write_text(out / PAGE, page)
    return found


def _table_2(vehicle: Vehicle) -> list[dict[str, float]]:
    """Return Table 2 with the line (15) and the line of least squares."""
    ratio = np.array([row[0] for row in TABLE_2])
    printed = np.array([float(row[1]) for row in TABLE_2])
    slope, static = np.polyfit(ratio, printed, 1)
    k1, k2 = vehicle["thrust_static"], vehicle["thrust_slope"]
    return [
        {
            "advance_ratio": float(j),
            "printed": float(k),
            "line_15": float(k1 + k2 * j),
            "least_squares": float(static + slope * j),
        }
        for j, k in zip(ratio, printed, strict=True)
    ]
