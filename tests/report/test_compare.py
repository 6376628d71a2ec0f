"""Errors, validation uncertainties and labels against numbers worked out apart from the package."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import root
from synthetic import PETREL, SETTINGS, blocks, closure_angle, level_blocks, steady

from pipeline.model.predict import predict
from pipeline.report.compare import COLUMNS, SHARED, compare, independence, kinematic_sensitivities
from pipeline.vehicle import Coefficient, Polar, Vehicle


def rows(table: pd.DataFrame, trim: str, quantity: str) -> pd.DataFrame:
    return table[(table["trim"] == trim) & (table["quantity"] == quantity)]


def kinematic_speed(depth_rate: float, pitch: float, **changes: float) -> float:
    return depth_rate / -math.sin(pitch - closure_angle(pitch, **changes))


def only(petrel: Vehicle, *names: str) -> Vehicle:
    """Return Petrel-II of whose coefficients only `names` are uncertain."""
    return Vehicle(
        petrel.name,
        "",
        {
            name: Coefficient(item.value, item.std if name in names else 0.0, item.unit, item.source)
            for name, item in petrel.coefficients.items()
        },
    )


# Percent change of the kinematic speed at pitch −20°, −25°, −45°: table of estimation.md §1, measured on simulated
# glides for a whole step, hence the tolerance for a derivative.
@pytest.mark.parametrize(
    ("name", "step", "published"),
    [
        ("lift_slope", 0.1 * PETREL["lift_slope"], (1.28, 0.80, 0.18)),
        ("parasite_drag", 0.1 * PETREL["parasite_drag"], (-1.22, -0.80, -0.19)),
        ("pitch", math.radians(1.0), (3.49, 3.07, 1.65)),
    ],
)
def test_kinematic_sensitivities_reproduce_the_table_of_borrowed_errors(petrel, name, step, published):
    pitch = np.radians([-20.0, -25.0, -45.0])
    alpha = np.array([closure_angle(angle) for angle in pitch])
    slopes = kinematic_sensitivities(petrel.polar, np.full(3, 0.5), pitch - alpha, alpha)
    percent = 100.0 * slopes[name][0] / 0.5 * step
    np.testing.assert_allclose(percent, published, atol=0.25)


@pytest.mark.parametrize("exponent", [0.0, -0.5])
@pytest.mark.parametrize("pitch_deg", [-35.0, -22.0, 28.0])
def test_kinematic_sensitivities_are_the_slopes_of_the_closure(exponent, pitch_deg):
    base = {"lift_at_zero": 2.0, "lift_slope": 340.0, "parasite_drag": 7.0, "induced_drag": 300.0}
    pitch, rate = math.radians(pitch_deg), -0.2 * math.copysign(1.0, pitch_deg)

    def solve(angle: float, **changes: float) -> np.ndarray:
        c = base | changes

        def balance(x: np.ndarray) -> list[float]:
            speed, alpha = x
            path = angle - alpha
            lift = c["lift_at_zero"] + c["lift_slope"] * alpha
            drag = c["parasite_drag"] * speed**exponent + c["induced_drag"] * alpha**2
            return [math.sin(path) * lift + math.cos(path) * drag, speed * math.sin(path) + rate]

        found = root(balance, [0.45, -0.03 * math.copysign(1.0, angle)], tol=1e-15)
        assert np.max(np.abs(found.fun)) < 1e-12
        return np.array([found.x[0], angle - found.x[1]])

    speed, path = solve(pitch)
    polar = Polar(**base, drag_exponent=exponent)
    slopes = kinematic_sensitivities(polar, np.array([speed]), np.array([path]), np.array([pitch - path]))
    for name in SHARED:
        step = 1e-5 if name == "pitch" else 1e-4 * base[name]
        up, down = (
            solve(pitch + sign * step) if name == "pitch" else solve(pitch, **{name: base[name] + sign * step})
            for sign in (1.0, -1.0)
        )
        expected = (up - down) / (2.0 * step)
        np.testing.assert_allclose([part[0] for part in slopes[name]], expected, rtol=2e-5, atol=1e-9, err_msg=name)


def test_error_and_uncertainty_of_a_sensor_comparison_by_hand(petrel):
    table = blocks(dives=1, each=1, sides=(-1,))
    table["sensor_speed"], table["sensor_speed_std"] = 0.38, 0.04
    predictions = predict(petrel, table)
    held = predictions["trim"] == "pitch"
    predictions.loc[held, ["speed", "speed_std"]] = 0.40, 0.03
    row = rows(compare(table, predictions, petrel, settings=SETTINGS), "pitch", "sensor_speed").iloc[0]
    assert row["error"] == pytest.approx(0.02)
    assert row["covariance"] == 0.0
    assert row["u_num"] < 1e-9
    # The effects of the inputs are larger than the 3 cm/s put in here; u_val is what they and the sensor make.
    effects = sum(row[f"predicted_{name}"] ** 2 for name in (*SHARED, "thrust_scale", "net_buoyancy"))
    assert row["u_val"] == pytest.approx(math.sqrt(max(effects, 0.03**2) + 0.04**2), rel=1e-6)
    assert row["significance"] == pytest.approx(0.02 / row["u_val"])
    assert row["label"] == "independent"


@pytest.mark.parametrize("name", ["lift_slope", "parasite_drag", "induced_drag"])
def test_u_val_is_the_change_of_the_error_when_a_shared_coefficient_is_wrong(petrel, name):
    vehicle = only(petrel, name)
    table = blocks(dives=1, each=1, sides=(-1,), pitches_deg=(25.0,), sigma_w=0.0, noise=0.0)
    table[["pitch_std", "net_buoyancy_std", "propeller_speed_std"]] = 0.0
    pitch, rate, force = (float(table[column].iloc[0]) for column in ("pitch", "depth_rate", "net_buoyancy"))
    step = 0.001 * vehicle.std(name)
    up, down = ({name: PETREL[name] + sign * step} for sign in (1.0, -1.0))
    moved = (steady(force, pitch, **up)[0] - steady(force, pitch, **down)[0]) / 0.002
    measured = (kinematic_speed(rate, pitch, **up) - kinematic_speed(rate, pitch, **down)) / 0.002
    table["speed_std"] = abs(measured)  # all of the measured side's uncertainty is this coefficient's
    row = rows(compare(table, predict(vehicle, table), vehicle, settings=SETTINGS), "pitch", "speed").iloc[0]
    assert row["u_val"] == pytest.approx(abs(moved - measured), rel=1e-3)
    assert row["covariance"] == pytest.approx(moved * measured, rel=1e-3)
    identity = row["u_num"] ** 2 + row["u_input"] ** 2 + row["u_measured"] ** 2 - 2.0 * row["covariance"]
    assert row["u_val"] ** 2 == pytest.approx(identity, rel=1e-3)


def test_without_corrections_to_find_the_error_vanishes_in_still_water(petrel):
    table = blocks(dives=2, sigma_w=0.0, noise=0.0)
    out = compare(table, predict(petrel, table), petrel, settings=SETTINGS)
    for quantity in ("speed", "depth_rate", "path_angle"):
        np.testing.assert_allclose(rows(out, "pitch", quantity)["error"], 0.0, atol=1e-8)


def test_depth_rate_counts_the_moving_water_on_the_measured_side(exact):
    table = blocks(dives=1, each=1, sides=(-1,), noise=0.0)
    out = compare(table, predict(exact, table), exact, settings={"sigma_w": 0.02, "tau_w": 1e7})
    assert rows(out, "pitch", "depth_rate")["u_measured"].iloc[0] == pytest.approx(0.02, rel=1e-3)


def test_labels_say_how_independent_the_two_sides_are(petrel):
    table = blocks(dives=1, each=1, sensor=True)
    out = compare(table, predict(petrel, table), petrel, settings=SETTINGS)
    labels = {
        quantity: set(rows(out, "pitch", quantity)["label"])
        for quantity in ("speed", "sensor_speed", "depth_rate", "path_angle")
    }
    assert labels == {
        "speed": {"shares polar"},
        "sensor_speed": {"independent"},
        "depth_rate": {"independent"},
        "path_angle": {"circular"},
    }
    assert set(rows(out, "fixed_alpha", "pitch")["label"]) == {"independent"}
    assert out["why"].str.len().min() > 20
    assert rows(out, "pitch", "path_angle")["significance"].isna().all()
    assert rows(out, "pitch", "pitch").empty


@pytest.mark.parametrize("powered", [False, True])
@pytest.mark.parametrize("trim", ["pitch", "battery", "fixed_alpha"])
@pytest.mark.parametrize("sensor_used", [False, True])
def test_a_kinematic_speed_is_never_called_independent(powered, trim, sensor_used):
    assert independence("speed", trim=trim, powered=powered, sensor_used=sensor_used)[0] == "shares polar"


def test_gps_speed_is_compared_with_the_mean_theory_of_level_powered_blocks(petrel):
    table = level_blocks()
    out = compare(table, predict(petrel, table), petrel, settings=SETTINGS, gps=(0.62, 0.01))
    row = rows(out, "pitch", "gps_speed").iloc[0]
    assert row["block"] == -1
    assert row["predicted"] == pytest.approx(0.615, abs=5e-4)
    assert row["error"] == pytest.approx(0.615 - 0.62, abs=5e-4)
    assert row["label"] == "independent"


def test_gps_speed_needs_level_powered_blocks(petrel):
    table = blocks(dives=1)
    out = compare(table, predict(petrel, table), petrel, settings=SETTINGS, gps=(0.62, 0.01))
    assert rows(out, "pitch", "gps_speed").empty


def test_a_vehicle_without_coefficients_gives_an_empty_table_with_its_columns(unknown):
    table = blocks(dives=1)
    out = compare(table, predict(unknown, table), unknown, settings=SETTINGS)
    assert out.empty
    assert list(out.columns) == list(COLUMNS)


def test_blocks_left_out_are_not_compared(petrel):
    table = blocks(dives=1)
    table["used"] = False
    assert compare(table, predict(petrel, table), petrel, settings=SETTINGS).empty
