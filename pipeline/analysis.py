"""A mission analysed in memory: what `seatrial run` files away, at hand in a notebook, and nothing written."""

from __future__ import annotations

import html
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import mission as missions
from pipeline import provenance, store
from pipeline.roster import inputs as logs_of
from pipeline.roster import resolve_vehicle

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.mission import Mission
    from pipeline.report import Inputs, Report
    from pipeline.vehicle import Vehicle

#: Height of a page inside a notebook, pixels.
HEIGHT = 800


@dataclass(frozen=True)
class Page:
    """A page of HTML; a notebook shows it, `save` writes it."""

    text: str

    def save(self, path: str | Path) -> Path:
        """Write the page to `path`, and return that."""
        store.write_text(Path(path), self.text)
        return Path(path)

    def _repr_html_(self) -> str:
        source = html.escape(self.text, quote=True)
        return f'<iframe srcdoc="{source}" title="report" width="100%" height="{HEIGHT}" style="border:0"></iframe>'


class Trial:
    """A mission that has been analysed; a notebook shows its answer and key numbers.

    Parameters
    ----------
    inputs
        What the stages before the report hand over.

    Attributes
    ----------
    mission, vehicle
        As resolved: the vehicle with the mission's overrides.
    records, estimates, force, blocks, predictions
        The canonical tables of `pipeline.records`; estimates by the kinematic method, and by the force method.
    """

    def __init__(self, inputs: Inputs) -> None:
        self._inputs = inputs
        self.mission: Mission = inputs.mission
        self.vehicle: Vehicle = inputs.vehicle
        self.records = inputs.records
        self.estimates = inputs.estimates
        self.force = inputs.force
        self.blocks: pd.DataFrame = inputs.blocks
        self.predictions: pd.DataFrame = inputs.predictions

    @property
    def summary(self) -> dict[str, Any]:
        """What summary.json holds."""
        return self._built.summary

    @cached_property
    def corrected(self) -> Vehicle:
        """The vehicle as the mission has corrected it, what vehicle.yaml holds."""
        from pipeline.report.corrected import of_mission

        return of_mission(self._inputs).vehicle

    def report(self, path: str | Path | None = None) -> Page:
        """Return the page that people read, report.html; write it to `path` if that is given."""
        page = Page(self._built.page)
        if path is not None:
            page.save(path)
        return page

    @cached_property
    def _built(self) -> Report:
        from pipeline.report import build

        return build(self._inputs)

    def __repr__(self) -> str:
        return f"{self.mission.slug}: {self.summary['answer']['sentence']}"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th>{html.escape(row['name'])}</th><td>{_amount(row)}</td><td>{html.escape(row['unit'])}</td>"
            f"<td>{html.escape(row['remark'])}</td></tr>"
            for row in self.summary["key_numbers"]
        )
        answer = html.escape(self.summary["answer"]["sentence"])
        title = html.escape(f"{self.mission.slug} · {self.vehicle.name}")
        return f"<p>{title}</p><p><strong>{answer}</strong></p><table><tbody>{rows}</tbody></table>"


def analyse(folder: str | Path, *, threads: int | None = None) -> Trial:
    """Take one mission through all stages in memory; nothing is written.

    Parameters
    ----------
    folder
        Of the logs, with a mission.yaml.
    threads
        On how many threads the estimates are made; all cores if left out. No number depends on it.

    Raises
    ------
    InputError
        If the mission cannot be analysed; one line says which file, what was found, expected, and what to do.
    """
    import pandas as pd

    from pipeline.estimate.stage import InMemory, stream
    from pipeline.ingest import ingest
    from pipeline.model.predict import predict
    from pipeline.records import of_method
    from pipeline.report import Inputs
    from pipeline.workers import cores

    mission = missions.load(Path(folder))
    read, _beside = logs_of(mission)
    ingested = ingest(mission)
    vehicle = resolve_vehicle(mission, ingested.constants)
    parts: list[pd.DataFrame] = []
    estimated = stream(
        InMemory(ingested.records),
        vehicle,
        mission,
        parts.append,
        constants=ingested.constants,
        threads=threads or cores(),
    )
    estimates = pd.concat(parts, ignore_index=True)
    return Trial(
        Inputs(
            mission=mission,
            vehicle=vehicle,
            records=ingested.records,
            estimates=of_method(estimates, "kinematic"),
            force=of_method(estimates, "force"),
            blocks=estimated.blocks,
            predictions=predict(vehicle, estimated.blocks),
            stored=ingested.stored,
            ingest={
                "format": ingested.format,
                "constants": ingested.constants,
                "findings": [finding.as_dict() for finding in ingested.findings],
            },
            estimate=store.plain(
                {**estimated.report, "findings": [finding.as_dict() for finding in estimated.findings]}
            ),
            provenance={"stages": {"ingest": provenance.key("ingest", provenance.digests(read), {})}},
        )
    )


def _amount(row: dict[str, Any]) -> str:
    """Return a key number with its 1-sigma, a dash where there is none."""
    value, std = row["value"], row["std"]
    if isinstance(value, int):
        return str(value)
    if not isinstance(value, float) or not math.isfinite(value):
        return "–"
    return f"{value:.3f}" + (f" ± {std:.3f}" if isinstance(std, float) and math.isfinite(std) else "")
