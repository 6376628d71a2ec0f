"""The pages in a real browser, from disk and with the network off."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import pipeline
from pipeline import store
from pipeline.report import Report, index
from pipeline.report.figures import files

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: it is in the extra 'test'")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium found: install the distribution's 'chromium'")

#: What is looked at of a page by its width in pixels: from a desk and from a telephone.
WIDTHS = (1280, 390)
WIDER = """() => [...document.querySelectorAll('body *')].filter(item => !item.closest('.scroll, svg, pre, .bk-Figure')
    && item.getBoundingClientRect().right > innerWidth + 1).map(item => item.outerHTML.slice(0, 80))"""


@pytest.fixture(scope="module")
def pages(built: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a campaign of one mission to disk."""
    root = tmp_path_factory.mktemp("reports")
    folder = root / built.summary["mission"]
    folder.mkdir()
    (folder / "report.html").write_text(built.page, encoding="utf-8")
    files.write(folder.joinpath, built.pictures, {"mission": built.summary["mission"]})
    summaries = [store.plain(built.summary), {"mission": "lost", "error": "records: no pressure"}]
    campaign = index(summaries)
    (root / "index.html").write_text(campaign.page, encoding="utf-8")
    files.write(root.joinpath, campaign.pictures, {}, files.CAMPAIGN)
    return root


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync_api.sync_playwright() as playwright:
        flags = ["--no-sandbox"] if os.geteuid() == 0 else []
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=flags)


@pytest.fixture
def look(browser: Any, pages: Path) -> Iterator[Any]:
    """Open a page of the campaign at a width; when the test is over it must have logged no error nor asked for more."""
    contexts: list[Any] = []
    troubles: list[str] = []

    def opened(name: str, width: int = 1280, *, scheme: str = "light", scripts: bool = True) -> Any:
        context = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True, java_script_enabled=scripts
        )
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("console", lambda said: troubles.append(said.text) if said.type in ("error", "warning") else None)
        page.on(
            "request", lambda asked: None if asked.url.startswith(("file:", "data:")) else troubles.append(asked.url)
        )
        page.goto((pages / name).as_uri())
        if scripts and name != "index.html":
            page.wait_for_selector("figure.live")
        return page

    yield opened
    for context in contexts:
        context.close()
    assert troubles == []


REPORT = "complete/report.html"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", [REPORT, "index.html"])
def test_nothing_overflows_and_axe_finds_no_serious_fault(look: Any, name: str, width: int, scheme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is in the extra 'test'")
    page = look(name, width, scheme=scheme)
    page.evaluate("document.querySelectorAll('details').forEach(item => item.open = true)")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(WIDER) == []
    found = axe.Axe().run(page).response["violations"]
    grave = [
        (fault["id"], fault["nodes"][0]["html"][:200], fault["nodes"][0]["failureSummary"])
        for fault in found
        if fault["impact"] in ("serious", "critical")
    ]
    assert grave == []


SCROLLS = """() => [...document.querySelectorAll('.scroll:not(.static)')]
    .filter(item => item.scrollWidth > item.clientWidth + 1).map(item => item.getAttribute('aria-label'))"""


@pytest.fixture(scope="module")
def trial(pages: Path) -> str:
    """Write the page of a simulated trial, which has most to stand side by side: published, printed, flown."""
    name = "petrel2-danjiangkou-2014"
    (pages / name).mkdir()
    found = pipeline.analyse(Path(__file__).parents[2] / "raw" / name, threads=1).report()
    (pages / name / "report.html").write_text(found.text, encoding="utf-8")
    return f"{name}/report.html"


@pytest.mark.parametrize(("width", "media"), [(1280, "screen"), (700, "print")])
@pytest.mark.parametrize("which", ["everything", "trial"])
def test_every_table_is_seen_whole_at_a_desk_and_on_paper(
    look: Any, request: pytest.FixtureRequest, which: str, width: int, media: str
) -> None:
    """On A4 a table can not be scrolled, and at a desk nobody does: what stands last is how independent it is."""
    page = look(request.getfixturevalue("trial") if which == "trial" else REPORT, width)
    page.emulate_media(media=media)
    page.evaluate("document.querySelectorAll('details').forEach(item => item.open = true)")
    assert page.evaluate(SCROLLS) == []


def test_every_figure_is_drawn(look: Any, built: Report) -> None:
    page = look(REPORT)
    drawn = {name for name, picture in built.pictures.items() if picture is not None}
    for name in drawn - {"flight"}:
        box = page.locator(f"#figure-{name} svg").bounding_box()
        assert box["width"] > 300
        assert box["height"] > 100
    ink = """() => { let found = 0; const look = root => { for (const item of root.querySelectorAll('*')) {
        if (item.shadowRoot) look(item.shadowRoot);
        if (item.tagName === 'CANVAS' && item.width && item.getContext('2d')
            .getImageData(0, 0, item.width, item.height).data.some(value => value)) found += 1; } };
        look(document.getElementById('series-plot')); return found; }"""
    assert page.evaluate(ink) >= 5


#: The middle of the third panel, that of speed, on the screen.
MIDDLE_OF_SPEED = """() => {
    const panels = [];
    const look = root => root.querySelectorAll('*').forEach(item => {
        if (item.classList.contains('bk-Figure')) panels.push(item.getBoundingClientRect());
        if (item.shadowRoot) look(item.shadowRoot);
    });
    look(document.getElementById('series-plot'));
    return [panels[2].x + panels[2].width / 2, panels[2].y + panels[2].height / 2];
}"""
#: Whether a tool tip with time, value and interval stands anywhere on the page.
TOLD = """() => {
    const words = root => [...root.querySelectorAll('*')].map(item =>
        item.shadowRoot ? words(item.shadowRoot) : item.children.length ? '' : item.textContent).join(' ');
    return /time: .*speed, m\\/s: .*2σ: .*to/.test(words(document.body).replace(/\\s+/g, ' '));
}"""
RANGE = "(() => { const time = seatrialSeries.get_model_by_name('time'); return [time.start, time.end]; })()"


def test_the_series_zooms_by_button_by_list_and_by_drag_all_panels_together(look: Any, built: Report) -> None:
    page = look(REPORT)
    start, end = page.evaluate(RANGE)
    page.get_by_role("button", name="Closer").click()
    assert page.evaluate(RANGE)[1] - page.evaluate(RANGE)[0] == pytest.approx((end - start) / 2)
    page.locator("#series-window").select_option(index=1)
    apex = page.evaluate("Date.parse(document.getElementById('series-window').value)")
    assert page.evaluate(RANGE) == pytest.approx([apex - 90e3, apex + 90e3])
    page.locator("#series-window").select_option(index=0)
    assert page.evaluate(RANGE) == pytest.approx([start, end])
    plots = page.evaluate("['depth', 'water'].map(name => seatrialSeries.get_model_by_name(name).x_range.id)")
    assert len(set(plots)) == 1
    box = page.locator("#series-plot").bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 60, steps=5)
    page.mouse.up()
    page.wait_for_function(f"{RANGE}[1] - {RANGE}[0] < {0.5 * (end - start)}")


def test_pointing_at_the_speed_tells_time_value_and_interval(look: Any) -> None:
    page = look(REPORT)
    page.locator("#series-window").select_option(index=1)
    page.locator("#series-plot").scroll_into_view_if_needed()
    place = page.evaluate(MIDDLE_OF_SPEED)
    page.mouse.move(place[0] - 20, place[1])
    page.mouse.move(*place, steps=4)
    page.wait_for_function(TOLD)


def test_layers_are_hidden_and_shown(look: Any) -> None:
    page = look(REPORT)
    shown = "[...seatrialSeries._all_models.values()].filter(m => m.glyph && m.tags[0] === 'held' && m.visible).length"
    before = page.evaluate(shown)
    page.locator(".layers input[value=held]").uncheck()
    assert (before > 0, page.evaluate(shown)) == (True, 0)


def test_without_scripts_and_in_print_the_drawing_stands_in_its_place(look: Any, tmp_path: Path) -> None:
    page = look(REPORT, scripts=False)
    assert page.locator("#figure-flight svg").is_visible()
    assert not page.locator("#series").is_visible()
    page = look(REPORT)
    assert not page.locator("#figure-flight .static svg").is_visible()
    page.emulate_media(media="print")
    assert page.locator("#figure-flight .static svg").is_visible()
    for hidden in ("#series", "nav", ".help"):
        assert not page.locator(hidden).first.is_visible()
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    assert len(page.pdf(path=str(tmp_path / "page.pdf"))) > 50_000


def test_dark_paints_the_series_in_the_colours_of_the_style_sheet(look: Any) -> None:
    page = look(REPORT, scheme="dark")
    line = "[...seatrialSeries._all_models.values()].find(m => m.glyph?.type === 'Line' && m.tags[0] === 'measured')"
    assert page.evaluate(f"{line}.glyph.line_color.value") == "#56b4e9"
    page.emulate_media(color_scheme="light")
    page.wait_for_function(f"{line}.glyph.line_color.value === '#0072b2'")


def test_help_opens_by_keyboard(look: Any) -> None:
    page = look(REPORT)
    help_of_speed = page.locator("#figure-answer details.help")
    help_of_speed.locator("summary").focus()
    page.keyboard.press("Enter")
    assert help_of_speed.locator("dl").is_visible()


def test_the_index_sorts_by_a_column_and_says_what_failed(look: Any) -> None:
    page = look("index.html")
    page.get_by_role("button", name="mission").first.click()
    assert page.locator("th[aria-sort=ascending]").count() == 1
    assert page.get_by_text("records: no pressure").is_visible()
