"""Pages to look at: a parser of them, the inputs of a mission that has everything, and its figures as drawn."""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from markupsafe import Markup
from matplotlib.figure import Figure
from synthetic import blocks, inputs, stored_model

from pipeline import store
from pipeline.mission import Mission
from pipeline.report import frontpage, page
from pipeline.report.figures import drawing

VOID = {"meta", "link", "br", "hr", "img", "input", "path", "use", "image", "rect", "circle", "line"}


class Page(HTMLParser):
    """Collects what a page loads, its headings and identifiers, and whether its tags close."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.headings: list[int] = []
        self.identifiers: list[str] = []
        self.figures: list[str] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "figure":
            self.figures.append("")
        if tag == "svg" and "figure" in self.open:
            self.figures[-1] = (found.get("role") == "img" and found.get("aria-label")) or ""
        if tag in ("h1", "h2", "h3"):
            self.headings.append(int(tag[1]))
        if "id" in found:
            self.identifiers.append(found["id"])
        if tag != "a":
            self.loads += [value for key, value in attributes if key in ("src", "href", "xlink:href") and value]

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.text.append(data)

    @property
    def words(self) -> str:
        return " ".join(" ".join(self.text).split())


#: Stand around what a template takes from data, while it says so; all else is its own text.
OPEN, SHUT = "\ue000", "\ue001"


class Data(Page):
    """Collects the text that comes from data: all but what templates say themselves, and the help beside figures."""

    def __init__(self, text):
        self.depth, self.help = 0, 0
        super().__init__(text)

    def handle_starttag(self, tag, attributes):
        attributes = [(key, re.sub(f"[{OPEN}{SHUT}]", "", value or "")) for key, value in attributes]
        super().handle_starttag(tag, attributes)
        if tag == "details" and dict(attributes).get("class") == "help":
            self.help = len(self.open)

    def handle_endtag(self, tag):
        if len(self.open) == self.help:
            self.help = 0
        super().handle_endtag(tag)

    def handle_data(self, data):
        kept = []
        for part in re.split(f"([{OPEN}{SHUT}])", data):
            self.depth += (part == OPEN) - (part == SHUT)
            kept.append(part if self.depth and not self.help and part not in (OPEN, SHUT) else " " * bool(part))
        super().handle_data("".join(kept))


def marked(value):
    return value if isinstance(value, Markup) and OPEN in value else Markup("{}{}{}").format(OPEN, value, SHUT)


def said(content):
    """Return the numbers that a summary holds, lengths of its lists among them, and its texts."""
    values, texts = [], []
    if isinstance(content, dict):
        parts = list(content.values())
        texts += [str(key) for key in content]
    else:
        parts = content if isinstance(content, list) else []
        values += [float(len(content))] if isinstance(content, list) else []
    if isinstance(content, str):
        texts.append(content)
    elif isinstance(content, int | float) and not isinstance(content, bool):
        values.append(float(content))
    for part in parts:
        more = said(part)
        values += more[0]
        texts += more[1]
    return values, texts


#: A number as it stands in a text, apart from names and versions.
NUMBER = r"(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\w)"


@contextmanager
def marking() -> Iterator[None]:
    """Mark in every page that is rendered what comes from data."""
    environment = page.environment

    def made():
        found = environment()
        found.finalize = marked
        return found

    with pytest.MonkeyPatch.context() as patched:
        for module in (page, frontpage):
            patched.setattr(module, "environment", made)
        yield


def numbers(text):
    """Return the numbers that a marked page takes from data."""
    return set(re.findall(NUMBER, Data(text).words))


def unsaid(text, content):
    """Return the numbers that a marked page takes from data and that are, as rounded there, not in `content`.

    Scaled by 100, they may be: the page has cm/s and %.
    """
    values, texts = said(json.loads(json.dumps(store.plain(content))))
    sizes = np.abs(values)

    def near(token):
        half = 0.5001 * 10.0 ** -len(token.partition(".")[2])
        return any(np.any(np.abs(sizes * scale - float(token)) <= half) for scale in (1, 100))

    written = set(re.findall(NUMBER, " ".join(texts)))
    return sorted(token for token in numbers(text) - written if not near(token))


def consistent(*, off=False):
    """Return a consistency report; if `off`, of an estimate that is not consistent, and without a pitch sensor."""
    words = "41 % larger than predicted" if off else "as large as predicted"
    seen = {
        "n": 4321, "nis": 1.991 if off else 1.004, "low": 0.958, "high": 1.043, "n_effective": 2987.6,
        "low_effective": 0.949, "high_effective": 1.051, "verdict": words, "lags": 20,
        "ljung_box": 812.4 if off else 21.7, "p": 0.0 if off else 0.357,
        "greatest_correlation": 0.314 if off else -0.022, "greatest_lag": 7,
        "whiteness": "correlated" if off else "white", "reason": "",
    }  # fmt: skip
    ahead = {
        "n": 71, "rms_error": 0.137, "predicted_rms": 0.131, "normalised": 1.09, "low": 0.698, "high": 1.356,
        "coverage95": 0.9437, "verdict": "as large as predicted", "reason": "",
    }  # fmt: skip
    reason = "0 measurements in steady flight; at least 30 are needed"
    pitch = dict.fromkeys(seen) | {"n": 0, "verdict": reason, "whiteness": reason, "reason": reason} if off else seen
    return {
        "innovations": [{"instrument": "depth", **seen}, {"instrument": "pitch", **pitch}],
        "predictions": [
            {"instrument": "depth", "unit": "m", "steps": 1, **ahead},
            {
                "instrument": "pitch",
                "unit": "deg",
                "steps": 60,
                **dict.fromkeys(ahead),
                "n": 3,
                "reason": "3 stretches",
            },
        ],
        "sensor": {"n": 931, "bias": 0.0038, "rmse": 0.0157, "coverage95": 0.961}
        if off
        else {"n": 877, "bias": -0.0042, "rmse": 0.0123, "coverage95": 0.934},
        "sentence": "It is not quite consistent: innovations of depth are 41 % larger than predicted."
        if off
        else "It is consistent: its errors are as large as it predicts, within 10 %.",
    }


def agreeing(**changes):
    """Return a compatibility report; each of `changes` replaces part of an entry."""
    plain = {"value": None, "std": None, "unit": "1", "significant": False, "applied": False, "reason": "none"}
    why = "needs a speed sensor that may be used"
    entries = {
        "outliers": {"value": 0, "reason": "none found",
                     "instruments": {name: {"count": 0, "first": []} for name in ("depth", "pitch", "speed")}},
        "clock_offset": {"value": -0.41, "std": 0.93, "unit": "s", "reason": "within"},
        "pressure_lag": {"unit": "s", "reason": "told by nothing"},
        "pressure_offset": {"value": 0.118, "std": 0.306, "unit": "dbar"},
        "pitch_bias": {"unit": "rad", "reason": why},
        "pitch_scale": {"reason": why},
    }  # fmt: skip
    return {name: plain | entry | changes.get(name, {}) for name, entry in entries.items()}


def adjusted(**changes):
    """Return the report on a force estimate; each of `changes` replaces part of a parameter's entry."""
    never = "considered: depth rate alone does not tell it from the others"
    entries = {
        "pitch": (0.0, 0.005236, 0.0, 0.005236, never),
        "parasite_drag": (-0.0284, 0.0367, 0.0, 0.1, "determined"),
        "lift_slope": (0.0, 0.25, 0.0, 0.25, never),
        "net_buoyancy": (-0.8142, 0.0905, 0.0, 0.3, "determined"),
        "compressibility": (5.2e-11, 9.9e-11, 0.0, 1e-10, "not determined by these data: mostly as before the mission"),
        "thermal_expansion": (5.41e-5, 9.3e-6, 0.0, 1e-5, "contradicts what was known before, by 5.4 sigma"),
        "hull_time": (241.0, 36.5, 150.0, 150.0, "determined"),
        "carried_water": (0.31, 0.08, 0.0, 0.25, "determined"),
        "flushing_time": (310.0, 150.0, 300.0, 300.0, "determined"),
    }
    keys = ("value", "std", "before", "std_before", "verdict")
    parameters = {name: dict(zip(keys, entry, strict=True)) | changes.get(name, {}) for name, entry in entries.items()}
    settings = {"sigma_w": 0.0034, "tau_w": 504.0, "depth_noise": 0.0199, "pitch_noise": 0.00289, "swell": 4e-6,
                "force_drift": 9e-6, "load": 0.115}  # fmt: skip
    return {"reason": "", "parameters": parameters, "untouched": ["thrust"], "converged": True, "observable_share": 0.9,
            "reasons": {"at the surface": 80, "stalled": 20}, "settings": settings}  # fmt: skip


@contextmanager
def caught() -> Iterator[dict[str, Figure]]:
    """Keep every figure of a report or an index that is drawn, by its name."""
    drawn: dict[str, Figure] = {}
    render = drawing.render

    def kept(figure: Figure, name: str) -> str:
        assert name not in drawn, f"two figures are called {name}"
        drawn[name] = figure
        return render(figure, name)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(drawing, "render", kept)
        yield drawn


def complete(petrel):
    """Return the inputs of a mission that has everything."""
    table = blocks(dives=6, sensor=True, extra_drag=1.0)
    made = inputs(
        Mission(vehicle="petrel-ii", name="complete", description="All there is, & more <than> that."),
        petrel,
        table,
        stored=stored_model(table, 0.76),
        force=True,
        estimate={
            "coverage": consistent()["sensor"],
            "compatibility": agreeing(clock_offset={"value": -1.481, "std": 0.471, "significant": True}),
            "force": adjusted(),
            "consistency": {"kinematic": consistent(), "force": consistent(off=True)},
            "gps": {
                "legs": [{"heading_deg": 90.0, "displacement_m": 700.0, "duration_s": 1000.0, "speed": None,
                          "speed_std": None, "current_east": 0.1, "current_north": 0.0}],
                "speed": None, "speed_std": None,
            },
        },
        findings=({"severity": "warning", "file": "ctd.csv", "where": "row 7", "found": "a <spike>", "expected": "none",
                   "remedy": "left out"},),
    )  # fmt: skip
    return replace(made, records=with_fixes(made.records), estimates=made.estimates.assign(path_angle=0.5))


def with_fixes(records):
    """Return records with a heading for each dive, and a fix before and after it: 0.5 m/s along it, 0.1 m/s current."""
    dive = records["dive"].to_numpy()
    heading = (1.3 * dive) % 6.28
    first = np.flatnonzero(np.diff(dive, prepend=0))
    place = np.concatenate([[0.0], np.cumsum(2000.0 * (0.5 * np.exp(1j * (0.5 * np.pi - heading[first])) + 0.1))])[:-1]
    out = records.assign(heading=heading, heading_qc=np.int8(1), latitude_qc=np.int8(1), longitude_qc=np.int8(1))
    out.loc[first, "latitude"] = 20.0 + place.imag / 110704.0
    out.loc[first, "longitude"] = 115.0 + place.real / 104647.0
    return out


def section(text, name):
    """Return the words of one section of a page."""
    return Page(text[text.index(f'<section id="{name}">') : text.index("</section>", text.index(f'id="{name}"'))]).words
