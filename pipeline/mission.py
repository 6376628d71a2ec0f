"""A mission: a folder of logs and its mission.yaml, strict to the last key."""

from __future__ import annotations

import itertools
import re
import types
import typing
from pathlib import Path
from typing import Any, Literal, Union

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from pipeline import yamlfile
from pipeline.findings import InputError, nearest

FILE = "mission.yaml"


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuse what YAML takes ``yes`` and ``on`` for where it is no answer: it would be taken for 1."""
        wanted = cls.model_fields[info.field_name or ""].annotation
        if isinstance(value, bool) and {int, float} & {wanted, *typing.get_args(wanted)}:
            raise PydanticCustomError("float_type", "a number")
        return value


class PitchCorrection(_Strict):
    """Calibration of the attitude sensor: pitch = scale · logged + offset, with the 1-sigma that remains."""

    scale: float = Field(
        1.0, gt=-5.0, lt=5.0, description="factor on the logged pitch, negative where nose down is positive"
    )
    offset_rad: float = Field(0.0, gt=-0.5, lt=0.5, description="rad, added after scaling, nose up positive")
    std_deg: float = Field(0.3, ge=0.0, lt=10.0, description="degrees, 1-sigma of the remaining pitch bias")

    @field_validator("scale")
    @classmethod
    def _not_flat(cls, scale: float) -> float:
        if abs(scale) <= 0.2:
            raise ValueError("a size greater than 0.2")
        return scale


class Ballast(_Strict):
    """What the vehicle weighs and displaces; net buoyancy follows from these and the engine's volume."""

    mass: float | None = Field(None, gt=0, lt=5000, description="kg; from the vehicle file if left out")
    volume: float | None = Field(None, gt=0, lt=5, description="m3, hull at the surface, engine at zero")
    neutral_density: float | None = Field(
        None, gt=900, lt=1100, description="kg/m3, density in which the vehicle hangs with the engine at zero"
    )
    std: float = Field(
        1.0,
        ge=0,
        description="N, 1-sigma of the constant part of net buoyancy; left out, 0.5 where the logs carry the hull's "
        "volume; never below 2 where nothing tells the volume",
    )

    @model_validator(mode="after")
    def _one_of(self) -> Ballast:
        if self.volume is not None and self.neutral_density is not None:
            raise ValueError("volume or neutral_density, not both")
        if self.mass is not None and self.volume is not None and not 900 < self.mass / self.volume < 1100:
            raise ValueError("a mass in kg and a volume in m3 that are 900 to 1100 kg/m3 together")
        return self


class Water(_Strict):
    """Water of a mission without a CTD: borrowed from elsewhere, and said to be wherever it is used."""

    density: float = Field(gt=900, lt=1100, description="kg/m3, in situ, at the surface")
    density_per_dbar: float = Field(
        0.0045, ge=0, lt=0.5, description="kg/m3 per dbar: compression alone, 1e4/c^2, unless it is stratified"
    )
    std: float = Field(1.0, ge=0, lt=50, description="kg/m3, 1-sigma of the density")
    temperature: float | None = Field(
        None,
        ge=-3,
        le=45,
        description="degrees Celsius, at the surface; the hull's reference temperature without",
    )
    temperature_per_dbar: float = Field(0.0, gt=-1, lt=1, description="K per dbar")
    source: str = Field("", description="where the numbers are from")


class TableColumn(_Strict):
    """One column of a plain table: its name in the file and its unit."""

    column: str = Field(description="name in the file's header")
    unit: str | None = Field(None, description="its unit; guessed from the header if left out")


class Table(_Strict):
    """How a plain table is to be read; what is left out is guessed from the header, and the guess is listed."""

    time: TableColumn | None = Field(None, description="column of the time")
    timezone: str = Field("UTC", description="IANA name of the zone that times without one are in")
    columns: dict[str, TableColumn | str] = Field(
        default_factory=dict, description="canonical name: column in the file (and its unit)"
    )
    ignore: list[str] = Field(default_factory=list, description="columns not to be read")


class Nominal(_Strict):
    """Settings and published results of one part of a trial, for the table of the paper's Section 5."""

    name: str = Field(description="heading in the table")
    net_buoyancy: float = Field(description="N, up positive")
    propeller_speed_rpm: float = Field(0.0, ge=0, le=6000, description="rev/min")
    propeller_power: float = Field(0.0, ge=0, description="W, where thrust follows from it and not from the speed")
    pitch_deg: float | None = Field(None, ge=-90, le=90, description="degrees, measured mean pitch")
    density: float | None = Field(None, gt=900, lt=1100, description="kg/m3; the vehicle's reference if left out")
    published_speed: float | None = Field(None, gt=0, description="m/s, measured speed as published")
    published_theory_speed: float | None = Field(None, gt=0, description="m/s, theoretical speed as published")
    published_theory_pitch_deg: float | None = Field(None, description="degrees, theoretical pitch as published")
    direction: Literal["up", "down", "level"] | None = Field(
        None, description="blocks this part is compared with: climbs, dives, or level flight"
    )
    powered: bool | None = Field(None, description="only blocks with, or without, the propeller turning")
    source: str = Field("", description="where the numbers are published")


class Configuration(_Strict):
    """What the vehicle carried outside on some dives: the drag of each configuration beside the first is fitted."""

    name: str = Field(min_length=1, description="as it stands on the page")
    dives: tuple[int, int] = Field(description="first and last dive flown like this")

    @field_validator("dives")
    @classmethod
    def _in_order(cls, dives: tuple[int, int]) -> tuple[int, int]:
        if dives[0] > dives[1]:
            raise ValueError("the first dive and the last, in this order")
        return dives


class Mission(_Strict):
    """One mission. `vehicle` is the only key that must be given."""

    vehicle: str = Field(description="name of a vehicle (`seatrial vehicles`), or a vehicle file beside mission.yaml")
    name: str = Field("", description="under which results are filed; the folder's name if left out")
    description: str = Field("", description="for the page")
    format: Literal["auto", "slocum", "seaglider", "table"] = Field(
        "auto", description="of the logs; recognised from the files"
    )
    latitude: float | None = Field(
        None, ge=-90, le=90, description="degrees north, for gravity, depth and salinity; else the median fix"
    )
    longitude: float | None = Field(None, ge=-180, le=360, description="degrees east; else the median fix")
    clock_offset: float = Field(
        0.0,
        ge=-3600,
        le=3600,
        description="s, added to the clock of the CTD before the instruments' records are merged",
    )
    pitch: PitchCorrection = Field(PitchCorrection(), description="calibration of the attitude sensor")
    ballast: Ballast = Field(Ballast(), description="what the vehicle weighs and displaces")
    coefficients: dict[str, float] = Field(
        default_factory=dict, description="values in place of those of the vehicle file"
    )
    files: dict[str, Table] = Field(default_factory=dict, description="plain tables by file name")
    salinity: Literal["measured", "baltic", "fresh"] = Field(
        "measured", description="'baltic': Baltic absolute salinity; 'fresh': no conductivity needed"
    )
    water: Water | None = Field(None, description="density and temperature of the water where there is no CTD")
    speed_sensor: Literal["check", "use", "ignore"] = Field(
        "check", description="a speed sensor is held out as a check, used by the estimator, or ignored"
    )
    speed_sensor_scale_std: float = Field(
        0.005,
        ge=0,
        le=0.3,
        description="1-sigma of the relative error of a speed sensor that is used: 0.005 for a Doppler log whose "
        "speed of sound is right, 0.03 to 0.1 for a flowmeter or a propeller log",
    )
    gps: Literal["use", "ignore"] = Field("use", description="speed between fixes at the ends of submerged legs")
    dives: tuple[int, int] | None = Field(None, description="first and last dive to analyse")
    minimum_block_s: float = Field(60.0, gt=0, description="s, shortest steady flight that makes a block")
    block_s: float = Field(300.0, gt=0, description="s, length at which steady flight is cut into blocks")
    nominal: list[Nominal] = Field(default_factory=list, description="published settings and results to compare with")
    configurations: list[Configuration] = Field(
        default_factory=list,
        description="sensors carried outside by dives; the first is the one that others are compared with",
    )
    folder: Path = Field(Path(), exclude=True)

    @field_validator("dives")
    @classmethod
    def _in_order(cls, dives: tuple[int, int] | None) -> tuple[int, int] | None:
        if dives is not None and dives[0] > dives[1]:
            raise ValueError("the first dive and the last, in this order")
        return dives

    @field_validator("configurations")
    @classmethod
    def _apart(cls, configurations: list[Configuration]) -> list[Configuration]:
        if len({item.name for item in configurations}) < len(configurations):
            raise ValueError("configurations of different names")
        in_order = sorted(item.dives for item in configurations)
        if any(later[0] <= earlier[1] for earlier, later in itertools.pairwise(in_order)):
            raise ValueError("each dive in one configuration at most")
        return configurations

    @property
    def slug(self) -> str:
        """The name under which results are filed."""
        return self.name or self.folder.name


def load(folder: Path) -> Mission:
    """Return the mission in `folder`.

    Raises
    ------
    InputError
        If mission.yaml is missing, is not YAML, has an unknown key (the nearest is named) or a value out of range.
    """
    path = folder / FILE
    where = f"{folder.name}/{FILE}"
    if not path.is_file():
        raise InputError(
            where,
            found="no mission.yaml",
            expected="one",
            remedy="the smallest useful one is 'vehicle: slocum-g2'",
        )
    content = yamlfile.content(path, where, "key: value")
    if not isinstance(content, dict):
        raise InputError(where, found="no keys", expected="at least 'vehicle: NAME'")
    if "folder" in content:
        raise InputError(where, "folder", found="an unknown key", remedy=nearest("folder", _keys(Mission)))
    try:
        return Mission(**{str(key): value for key, value in content.items()}, folder=folder)
    except ValidationError as error:
        raise _readable(error, where) from error


def _keys(model: type[BaseModel]) -> list[str]:
    return [name for name in model.model_fields if name != "folder"]


def _readable(error: ValidationError, file: str) -> InputError:
    """Turn the most telling of pydantic's complaints, a misspelt key before all others, into one line."""
    complaints = error.errors()
    first = next((item for item in complaints if item["type"] == "extra_forbidden"), complaints[0])
    place = ".".join(str(part) for part in first["loc"] if part not in ("TableColumn", "str"))
    if first["type"] == "extra_forbidden":
        key = str(first["loc"][-1])
        return InputError(file, place, found="an unknown key", remedy=nearest(key, _keys(_model_at(first["loc"][:-1]))))
    if first["type"] == "missing":
        add = "" if isinstance(first["loc"][-1], int) else f"add '{place}: …'"
        return InputError(file, place, found="nothing", expected="a value", remedy=add)
    found = "nothing" if first["input"] is None else repr(first["input"])[:80]
    return InputError(file, place, found=found, expected=_expectation(first))


_PLAINER = {
    "model_type": "keys and their values",
    "dict_type": "keys and their values",
    "list_type": "a list",
    "tuple_type": "a list",
    "string_type": "text",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "finite_number": "a finite number",
}


#: Letters of the longest unit; a description without one begins with more.
_LONGEST_UNIT = 16


def _expectation(complaint: Any) -> str:
    message: str = complaint["msg"].split(" should have ")[-1]
    words = _PLAINER.get(complaint["type"], message.removeprefix("Input should be ").removeprefix("Value error, "))
    return words + (_unit(complaint["loc"]) if complaint["type"].startswith(("greater_than", "less_than")) else "")


def _unit(loc: tuple[int | str, ...]) -> str:
    """Return the unit of the number at a location in mission.yaml, with which its description begins."""
    found = _model_at(loc[:-1]).model_fields.get(str(loc[-1]))
    unit = re.split("[,;:]", (found.description or "") if found else "")[0]
    return f" {unit}" if 0 < len(unit) <= _LONGEST_UNIT else ""


def _model_at(loc: tuple[int | str, ...]) -> type[BaseModel]:
    """Return the model that a location in mission.yaml is an instance of."""
    model: type[BaseModel] = Mission
    annotation: Any = Mission
    for part in loc:
        if isinstance(part, str) and part in model.model_fields:
            annotation = model.model_fields[part].annotation
        for candidate in _models(annotation):
            model = candidate
    return model


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Return the models named anywhere inside a type annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if typing.get_origin(annotation) in (list, dict, tuple, Union, types.UnionType):
        return [model for argument in typing.get_args(annotation) for model in _models(argument)]
    return []
