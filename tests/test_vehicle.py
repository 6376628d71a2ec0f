"""Vehicle files: what they must say, what they are refused for, and where their numbers come from."""

import math
from pathlib import Path
from typing import ClassVar

import pytest
import yaml

from pipeline import conventions, vehicle
from pipeline.findings import InputError

#: Vehicles whose lift and drag are not published.
SILENT = {"seaexplorer", "spray"}
#: Lift and drag.
POLAR = vehicle.Polar._fields
MASS = {"value": 70.0, "std": 1.0, "unit": "kg", "source": "scales"}


def refusal(content: object) -> str:
    with pytest.raises(InputError) as caught:
        vehicle.parse(content, "mine.yaml")
    return str(caught.value)


@pytest.mark.parametrize("name", vehicle.names())
def test_every_vehicle_of_the_package_says_what_the_theory_needs(name: str) -> None:
    found = vehicle.load(name)
    assert found.name == name
    assert found["reference_density"] > 0.0
    assert all(math.isfinite(found[key]) and math.isfinite(found.std(key)) for key in POLAR)
    assert bool(found.assumed(POLAR)) == (name in SILENT)
    assert all(coefficient.source for coefficient in found.coefficients.values())
    for coefficient in found.coefficients.values():
        assert math.isnan(coefficient.std) == math.isnan(coefficient.value)


def test_an_assumed_polar_of_a_glider_with_wings_covers_those_of_all_whose_own_is_known() -> None:
    assumed = vehicle.load("spray")
    for other in (vehicle.load(each) for each in vehicle.names() if each not in SILENT):
        drag = other["parasite_drag"] * 0.3 ** other["drag_exponent"]
        known = (other["lift_slope"], drag, other["induced_drag"])
        for key, value in zip(("lift_slope", "parasite_drag", "induced_drag"), known, strict=True):
            assert abs(value - assumed[key]) < 1.5 * assumed.std(key)


def test_a_glider_without_wings_is_assumed_to_lift_as_the_hull_of_one_with_wings_does() -> None:
    """Merckelbach et al. (2010): a Slocum's hull has a_h = 3.8 per rad of 7.53; a SeaExplorer's is wider, 0.25 m."""
    hull = 0.5 * 1025.0 * 0.1 * 3.8
    found, winged = vehicle.load("seaexplorer"), vehicle.load("spray")
    assert hull < found["lift_slope"] < hull * (0.25 / 0.22) ** 2
    assert found["lift_slope"] + found.std("lift_slope") < winged["lift_slope"]
    assert found["induced_drag"] / found["lift_slope"] == pytest.approx(280.0 / 360.0, abs=0.01)
    assert found["parasite_drag"] == winged["parasite_drag"]


def test_assumed_is_said_by_yes_or_no() -> None:
    content = {"coefficients": {"mass": MASS | {"assumed": "perhaps"}}}
    assert refusal(content) == "mine.yaml: mass: found assumed 'perhaps'; expected true or false"


def test_unknown_vehicle_names_the_nearest() -> None:
    with pytest.raises(InputError) as caught:
        vehicle.load("petrel-2")
    assert str(caught.value) == (
        "mission.yaml: vehicle: found 'petrel-2'; expected a known vehicle; did you mean 'petrel-ii'?"
    )


def test_missing_vehicle_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        vehicle.load("mine.yaml", tmp_path)
    assert str(caught.value) == "mine.yaml: found no such vehicle file; put it beside mission.yaml"


def test_vehicle_file_beside_the_mission_is_read(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump({"name": "mine", "coefficients": {"mass": MASS}}))
    mine = vehicle.load("mine.yaml", tmp_path)
    assert (mine.name, mine["mass"], mine.std("mass")) == ("mine", 70.0, 1.0)
    assert mine.propeller is None


def test_text_that_is_not_yaml_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("a: [1")
    with pytest.raises(InputError) as caught:
        vehicle.load("mine.yaml", tmp_path)
    assert str(caught.value) == "mine.yaml: line 1: found text that is not YAML; expected a vehicle file"


def test_a_coefficient_given_twice_is_refused(tmp_path: Path) -> None:
    entry = "{value: 70.0, std: 1.0, unit: kg, source: weighed}"
    (tmp_path / "mine.yaml").write_text(f"coefficients:\n  mass: {entry}\n  mass: {entry}\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        vehicle.load("mine.yaml", tmp_path)
    assert str(caught.value) == "mine.yaml: line 3: found 'mass' a second time; expected each key once"


def test_endless_brackets_are_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("a: " + 5000 * "[", encoding="utf-8")
    with pytest.raises(InputError, match=r"mine\.yaml: .*found text that is not YAML"):
        vehicle.load("mine.yaml", tmp_path)


@pytest.mark.parametrize("missing", ["std", "unit", "source"])
def test_coefficient_without_std_unit_or_source_is_refused(missing: str) -> None:
    entry = {key: value for key, value in MASS.items() if key != missing}
    assert refusal({"coefficients": {"mass": entry}}) == (
        f"mine.yaml: mass: found {entry!r}; expected the keys value, std, unit and source"
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({}, "mine.yaml: found no 'coefficients'; expected keys name, description, coefficients"),
        (
            {"coefficients": {}, "nmae": "x"},
            "mine.yaml: nmae: found an unknown key; did you mean 'name'?",
        ),
        (
            {"coefficients": {"parasit_drag": MASS}},
            "mine.yaml: parasit_drag: found an unknown coefficient; did you mean 'parasite_drag'?",
        ),
        (
            {"coefficients": {"mass": MASS | {"value": -70.0}}},
            "mine.yaml: mass: found -70 kg; expected a positive number",
        ),
        (
            {"coefficients": {"mass": MASS | {"value": math.inf}}},
            "mine.yaml: mass: found inf kg; expected a finite number",
        ),
        (
            {"coefficients": {"parasite_drag": {"value": 0.0, "std": 0.1, "unit": "kg/m", "source": "x"}}},
            "mine.yaml: parasite_drag: found 0 kg/m; expected a positive number",
        ),
        ({"coefficients": {"mass": MASS | {"unit": "g"}}}, "mine.yaml: mass: found unit 'g'; expected 'kg'"),
        (
            {"coefficients": {"mass": MASS | {"std": -1.0}}},
            "mine.yaml: mass: found std -1; expected a 1-sigma of zero or more",
        ),
        (
            {"coefficients": {"mass": MASS | {"value": "heavy"}}},
            "mine.yaml: mass: found 'heavy' ± 1.0; expected numbers or 'unknown'",
        ),
    ],
)
def test_wrong_vehicle_file_is_refused_in_one_line(content: object, message: str) -> None:
    assert refusal(content) == message


def test_unknown_coefficient_has_neither_value_nor_std() -> None:
    found = vehicle.parse({"coefficients": {"mass": MASS | {"value": "unknown", "std": "unknown"}}}, "mine.yaml")
    assert math.isnan(found["mass"])
    assert math.isnan(found.std("mass"))
    assert math.isnan(found["lift_slope"])
    assert math.isnan(found.std("lift_slope"))
    assert (found["lift_at_zero"], found.std("lift_at_zero")) == (0.0, 0.0)


def test_replaced_value_keeps_its_relative_std() -> None:
    petrel = vehicle.load("petrel-ii").with_values({"parasite_drag": 9.0, "lift_at_zero": 0.5}, "a fit")
    assert petrel["parasite_drag"] == 9.0
    assert petrel.std("parasite_drag") == pytest.approx(9.0 * 0.736 / 7.3579, rel=1e-12)
    assert petrel.coefficients["parasite_drag"].source == "a fit"
    assert petrel.std("lift_at_zero") == 0.0


def test_replaced_value_of_unknown_std_stays_unknown() -> None:
    slocum = vehicle.load("slocum-g2").with_values({"moment_slope": -300.0}, "a guess")
    assert slocum["moment_slope"] == -300.0
    assert math.isnan(slocum.std("moment_slope"))


def test_replacing_an_unknown_name_is_an_error() -> None:
    with pytest.raises(KeyError, match="parasit_drag"):
        vehicle.load("petrel-ii").with_values({"parasit_drag": 9.0}, "a typo")


def test_powered_flight_of_a_slocum_is_not_predicted_without_its_thrust_law() -> None:
    from pipeline.model.steady import NO_THRUST_LAW, trim_at_pitch

    thruster = vehicle.load("slocum-thruster")
    powered = trim_at_pitch(thruster, [0.0, -0.5], [0.0, -0.4], propeller_speed=[10.0, 0.0])
    assert list(powered.reason) == [NO_THRUST_LAW, ""]
    assert math.isfinite(powered.speed[1])
    assert math.isnan(powered.speed[0])


@pytest.fixture
def bare() -> vehicle.Vehicle:
    return vehicle.load("bare.yaml", Path(__file__).parent)


def test_a_vehicle_whose_lift_and_drag_nobody_knows_says_what_is_unknown(bare: vehicle.Vehicle) -> None:
    from pipeline.model.predict import free_angle_of_attack
    from pipeline.model.steady import trim_at_pitch

    glide = trim_at_pitch(bare, -0.5, -0.4)
    assert math.isnan(glide.speed)
    assert str(glide.reason) == "the vehicle file leaves lift_slope, parasite_drag, induced_drag unknown"
    assert free_angle_of_attack(bare)[1] == "the vehicle file leaves moment_at_zero, moment_slope unknown"
    assert math.isnan(conventions.to_seaglider(bare)["hd_a"])
    assert math.isnan(conventions.to_slocum(bare)["C_D0"])


def test_predictions_for_a_vehicle_whose_lift_and_drag_nobody_knows_are_nan_with_a_reason(
    bare: vehicle.Vehicle,
) -> None:
    import pandas as pd

    from pipeline.model.predict import predict
    from pipeline.records import BLOCKS, conform

    block = {"block": 1, "dive": 1, "direction": -1, "powered": False, "used": True}
    flown = block | {"net_buoyancy": -0.5, "pitch": -0.4, "density": 1027.0}
    found = predict(bare, conform(pd.DataFrame([flown]), BLOCKS))
    assert len(found) == 3
    assert found["speed"].isna().all()
    assert found["reason"].str.contains("the vehicle file").all()


class TestCorrelations:
    POLAR: ClassVar = {
        name: {"value": 1.0, "std": 0.1, "unit": vehicle.KNOWN[name].unit, "source": "fit"}
        for name in ("parasite_drag", "induced_drag", "lift_slope")
    }

    def content(self, correlations: object) -> dict[str, object]:
        return {"name": "mine", "coefficients": self.POLAR, "correlations": correlations}

    def test_are_kept_by_pairs(self) -> None:
        found = vehicle.parse(self.content({"parasite_drag": {"induced_drag": -0.4, "lift_slope": 0}}), "mine.yaml")
        assert found.correlations == {("parasite_drag", "induced_drag"): -0.4, ("parasite_drag", "lift_slope"): 0.0}
        names, matrix = vehicle.correlation_matrix(found.correlations)
        assert names == ["parasite_drag", "induced_drag", "lift_slope"]
        assert matrix.tolist() == [[1.0, -0.4, 0.0], [-0.4, 1.0, 0.0], [0.0, 0.0, 1.0]]

    def test_of_a_coefficient_that_is_replaced_are_dropped(self) -> None:
        found = vehicle.parse(
            self.content({"parasite_drag": {"induced_drag": 0.5}, "lift_slope": {"induced_drag": 0.1}}), "mine.yaml"
        )
        changed = found.with_values({"parasite_drag": 2.0}, "mission.yaml")
        assert changed.correlations == {("lift_slope", "induced_drag"): 0.1}

    @pytest.mark.parametrize(
        ("correlations", "line"),
        [
            ([0.5], "mine.yaml: correlations: found [0.5]; expected coefficient: {another: number}"),
            (
                {"parasite_drag": {"lift_slop": 0.5}},
                "mine.yaml: correlations.parasite_drag.lift_slop: found 'lift_slop', which has no value; "
                "did you mean 'lift_slope'?",
            ),
            (
                {"parasite_drag": {"lift_slope": 1.5}},
                "mine.yaml: correlations.parasite_drag.lift_slope: found 1.5; expected a number from -1 to 1",
            ),
            (
                {"parasite_drag": {"lift_slope": 0.5}, "lift_slope": {"parasite_drag": 0.5}},
                "mine.yaml: correlations.lift_slope.parasite_drag: found a pair that needs none; "
                "expected each pair of two once",
            ),
            (
                {"parasite_drag": {"lift_slope": 0.9, "induced_drag": 0.9}, "lift_slope": {"induced_drag": -0.9}},
                "mine.yaml: correlations: found an eigenvalue of -0.8; expected a matrix with none below zero; "
                "no errors are correlated like this",
            ),
        ],
    )
    def test_that_cannot_be_are_refused(self, correlations: object, line: str) -> None:
        assert refusal(self.content(correlations)) == line
