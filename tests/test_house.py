"""The house: rooms import from the floors below, records name all that they depend on, the manual is true."""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from pipeline import provenance
from pipeline.roster import STAGES

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "pipeline"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())

#: What each floor may use, itself and the ground floor aside; a module that is in no room and not named is ground.
MAY_USE: dict[str, set[str]] = {
    "ground": set(),
    "model": set(),
    "ingest": set(),
    "simulate": {"model"},
    "estimate": {"model"},
    "report": {"model"},
    "paper": {"model", "report"},
    "campaign": {"model", "ingest", "estimate", "report"},
    "cli": {"model", "ingest", "estimate", "report", "simulate", "paper", "campaign"},
}
FLOOR = {
    **dict.fromkeys(("simulate", "voyage", "plan", "trials", "instruments", "theory"), "simulate"),
    **dict.fromkeys(("analysis", "campaign", "check", "index", "roster"), "campaign"),
    "paper": "paper",
    **{name: name for name in ("model", "ingest", "estimate", "report", "cli")},
}


def modules() -> dict[str, Path]:
    """Return the modules of the package by dotted name."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(name: str, path: Path, known: set[str]) -> set[str]:
    """Return the modules of the package that a module imports, anywhere in it but for the sake of types."""
    found: set[str] = set()
    tree = ast.parse(path.read_text())
    typing = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in set(ast.walk(tree)) - typing:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{name}: relative import"
            inside = {f"{node.module}.{alias.name}" for alias in node.names} & known
            found |= inside or {node.module}
    return (found & known) - {name}


MODULES = modules()
IMPORTS = {name: imported(name, path, set(MODULES)) for name, path in MODULES.items()}


def floor(name: str) -> str:
    return FLOOR.get([*name.split("."), ""][1], "ground")


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_module_imports_only_from_its_own_floor_and_those_below(name: str) -> None:
    own = floor(name)
    above = {other for other in IMPORTS[name] if floor(other) not in MAY_USE[own] | {own, "ground"}}
    assert not above


def test_there_are_no_circles() -> None:
    done: set[str] = set()

    def visit(name: str, above: tuple[str, ...]) -> None:
        assert name not in above, " -> ".join([*above[above.index(name) :], name])
        if name not in done:
            for other in IMPORTS[name]:
                visit(other, (*above, name))
            done.add(name)

    for name in MODULES:
        visit(name, ())


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_is_run_again_when_any_source_it_uses_changes(stage: str) -> None:
    waiting = {name for name in MODULES if name.startswith(f"pipeline.{stage}")}
    needed: set[str] = set()
    while waiting:
        name = waiting.pop()
        needed.add(name)
        waiting |= IMPORTS[name] - needed
    sources = set(provenance.sources(stage))
    missing = {name for name in needed if MODULES[name] not in sources}
    assert not missing


def test_the_package_ships_every_file_it_needs() -> None:
    settings = PROJECT["tool"]["setuptools"]
    rooms = {".".join(path.parent.relative_to(ROOT).parts) for path in PACKAGE.rglob("__init__.py")}
    assert set(settings["packages"]) == rooms
    shipped = {path for pattern in settings["package-data"]["pipeline"] for path in PACKAGE.glob(pattern)}
    beside = {
        path
        for path in PACKAGE.rglob("*")
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
    }
    assert shipped == beside


def test_versions_agree() -> None:
    from pipeline import __version__

    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert PROJECT["project"]["version"] == __version__ == citation["version"]


def test_every_dependency_has_its_version_in_the_constraints() -> None:
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+", line) for line in lines)
    pinned = {re.split("==", line)[0].lower().replace("_", "-") for line in lines}
    extras = [item for extra in PROJECT["project"]["optional-dependencies"].values() for item in extra]
    wanted = {
        re.split("[<>=]", item)[0].lower().replace("_", "-") for item in PROJECT["project"]["dependencies"] + extras
    }
    assert wanted <= pinned


def test_the_tables_of_the_manual_are_those_of_the_code() -> None:
    spec = importlib.util.spec_from_file_location("tables", ROOT / "docs" / "tables.py")
    assert spec is not None
    assert spec.loader is not None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    for path in sorted((ROOT / "docs").glob("*.md")):
        assert tables.filled(path.read_text()) == path.read_text(), f"run python docs/tables.py: {path.name}"


def test_links_of_the_manual_lead_somewhere() -> None:
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "benchmarks").glob("*.md")]:
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text()):
            if not target.startswith("http"):
                assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_examples_of_mission_yaml_in_the_manual_are_valid() -> None:
    from pipeline.mission import Mission

    pages = (ROOT / "README.md").read_text() + (ROOT / "docs" / "mission.md").read_text()
    examples = re.findall(r"```yaml\n(.*?)```", pages, flags=re.DOTALL)
    assert len(examples) >= 4
    for example in examples:
        Mission(**yaml.safe_load(example))


def test_python_is_new_enough() -> None:
    assert sys.version_info >= (3, 11)
    assert PROJECT["project"]["requires-python"] == ">=3.11"
