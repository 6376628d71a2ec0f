"""A YAML file that people write: read, every key once, what is wrong with it said in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.findings import InputError


def content(path: Path, name: str, expected: str) -> Any:
    """Return what the file says.

    Parameters
    ----------
    path
        A file that is there.
    name
        What it is called in a message.
    expected
        What it should hold, in words.

    Raises
    ------
    InputError
        If it is not UTF-8 or not YAML, or if a mapping has a key twice, of which YAML would take the last in silence.
    """
    import yaml

    try:
        text = path.read_text(encoding="utf-8")
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        found = yaml.safe_load(text)
    except UnicodeDecodeError as error:
        remedy = "save it as UTF-8, or write it without accents"
        raise InputError(name, found="text that is not UTF-8", expected=expected, remedy=remedy) from error
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        line = f"line {mark.line + 1}" if mark else ""
        lines = text.splitlines()
        tab = mark is not None and mark.line < len(lines) and "\t" in lines[mark.line]
        remedy = "a tab is there; YAML takes spaces" if tab else ""
        raise InputError(name, line, found="text that is not YAML", expected=expected, remedy=remedy) from error
    twice = _repeated(root)
    if twice is not None:
        key, number = twice
        raise InputError(name, f"line {number}", found=f"'{key}' a second time", expected="each key once")
    return found


def _repeated(root: Any) -> tuple[str, int] | None:
    """Return the first key that a mapping anywhere below the YAML node `root` has twice, and its line."""
    nodes, met = [root], set()
    while nodes:
        node = nodes.pop()
        if id(node) in met or not isinstance(getattr(node, "value", None), list):
            continue
        met.add(id(node))
        if node.id == "sequence":
            nodes += node.value
            continue
        keys = set()
        for key, value in node.value:
            if key.id == "scalar" and key.value in keys:
                return str(key.value), key.start_mark.line + 1
            keys.add(key.value if key.id == "scalar" else id(key))
            nodes.append(value)
    return None
