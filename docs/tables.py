"""Write the tables of the manual from the code: ``python docs/tables.py``; a test keeps them true."""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from pipeline import records
from pipeline.mission import Mission
from pipeline.vehicle import KNOWN

FOLDER = Path(__file__).parent


def _models(annotation: object) -> Iterator[tuple[type[BaseModel], str]]:
    """Yield the models inside an annotation, with what stands between their key and theirs."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, ""
    between = {dict: ".NAME", list: "[]"}.get(typing.get_origin(annotation), "")
    if typing.get_origin(annotation) in (dict, list, typing.Union, types.UnionType):
        for argument in typing.get_args(annotation):
            for model, inner in _models(argument):
                yield model, between + inner


def _default(value: object) -> str:
    if value is PydanticUndefined:
        return "must be given"
    if value is None or value in ("", {}, []) or isinstance(value, BaseModel):
        return ""
    return f"`{value}`"


def keys(model: type[BaseModel] = Mission, prefix: str = "") -> Iterator[str]:
    """Yield one row for each key of mission.yaml: key, default, meaning."""
    for name, info in model.model_fields.items():
        if info.exclude:
            continue
        default = info.get_default(call_default_factory=True) if not info.is_required() else PydanticUndefined
        choices = typing.get_args(info.annotation) if typing.get_origin(info.annotation) is typing.Literal else ()
        choice = " or ".join(f"`{item}`" for item in choices)
        meaning = "; ".join(part for part in (info.description or "", choice) if part)
        yield f"| `{prefix}{name}` | {_default(default)} | {meaning} |"
        for inner, between in _models(info.annotation):
            yield from keys(inner, f"{prefix}{name}{between}.")


def columns(table: tuple[records.Column, ...]) -> Iterator[str]:
    """Yield one row for each column of a canonical table: name, unit, meaning."""
    for column in table:
        if not column.name.endswith("_qc"):
            yield f"| `{column.name}` | {column.unit} | {column.meaning} |"


def coefficients() -> Iterator[str]:
    """Yield one row for each coefficient of a vehicle file: symbol, name, unit, meaning."""
    for name, quantity in KNOWN.items():
        yield f"| {quantity.symbol} | `{name}` | {quantity.unit} | {quantity.meaning} |"


TABLES: dict[str, tuple[str, typing.Callable[[], Iterator[str]]]] = {
    "keys": ("| key | default | meaning |", keys),
    "records": ("| column | unit | meaning |", lambda: columns(records.RECORDS)),
    "estimates": ("| column | unit | meaning |", lambda: columns(records.ESTIMATES)),
    "blocks": ("| column | unit | meaning |", lambda: columns(records.BLOCKS)),
    "predictions": ("| column | unit | meaning |", lambda: columns(records.PREDICTIONS)),
    "stored": ("| column | unit | meaning |", lambda: columns(records.STORED)),
    "coefficients": ("| symbol | name in the code | unit | meaning |", coefficients),
}


def filled(text: str) -> str:
    """Return `text` with every table between ``<!-- table NAME -->`` and ``<!-- end -->`` written anew."""

    def table(found: re.Match[str]) -> str:
        head, rows = TABLES[found[1]]
        rule = re.sub(r"[^|]+", "---", head)
        return "\n".join([f"<!-- table {found[1]} -->", head, rule, *rows(), "<!-- end -->"])

    return re.sub(r"<!-- table (\w+) -->.*?<!-- end -->", table, text, flags=re.DOTALL)


if __name__ == "__main__":
    for path in sorted(FOLDER.glob("*.md")):
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
