"""The fleet is the same for the same seed, within its ranges, and as uncertain as the vehicle files say."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest, norm

from benchmarks import fleet
from benchmarks.fleet import Flight, Flown, first_flown, fly, plan_of
from pipeline import vehicle
from pipeline.findings import InputError
from pipeline.model.exchange import CARRIED_STD, FLUSHING_BEFORE, FLUSHING_STD
from pipeline.model.steady import trim_at_pitch
from pipeline.plan import Sea, Stage
from pipeline.records import seconds
from pipeline.simulate import run
from pipeline.vehicle import Coefficient

SEEDS = range(5000, 5600)


@functools.cache
def flights() -> tuple[Flight, ...]:
    return tuple(plan_of(seed) for seed in SEEDS)


@functools.cache
def flown(seed: int) -> tuple[Flight, Flown]:
    flight = plan_of(seed)
    return flight, fly(flight)


def glides(flight: Flight) -> Iterator[Stage]:
    """Return the orders of a mission's dives and climbs, powered level flight left out."""
    for before, stage in zip(flight.plan.stages, flight.plan.stages[1:], strict=False):
        if stage.end == "surface" or before.afloat:
            yield stage


def test_a_seed_gives_one_mission_whatever_was_drawn_before() -> None:
    first = repr(plan_of(77))
    plan_of(78)
    assert repr(plan_of(77)) == first
    assert repr(plan_of(78)) != first


def test_every_vehicle_with_a_known_polar_and_hull_flies() -> None:
    assert {flight.plan.vehicle.name for flight in flights()} == {
        "petrel-ii", "seaglider", "seaglider-sgx", "slocum-deep", "slocum-g2", "slocum-thruster",
    }  # fmt: skip


def test_only_a_vehicle_with_a_thrust_law_has_a_propeller_and_every_use_of_it_occurs() -> None:
    for flight in flights():
        powered = any(stage.rpm > 0.0 for stage in flight.plan.stages)
        assert powered == (flight.power != "none")
        assert flight.plan.vehicle.propeller is not None or not powered
    share = np.mean([flight.power != "none" for flight in flights()])
    assert share == pytest.approx(fleet.WITH_PROPELLER * fleet.POWERED, abs=0.06)
    assert {flight.power for flight in flights()} == {"none", "climbs", "dives and climbs", "level"}


def test_orders_stay_within_the_stated_ranges_and_fill_them() -> None:
    pitch = np.array([abs(stage.pitch_deg) for flight in flights() for stage in glides(flight)])
    force = np.array([abs(stage.net_buoyancy) for flight in flights() for stage in glides(flight)])
    depth = np.array([stage.value for flight in flights() for stage in glides(flight) if stage.end == "deeper"])
    dives = np.array([sum(stage.end == "surface" for stage in flight.plan.stages) for flight in flights()])
    rpm = np.array([stage.rpm for flight in flights() for stage in flight.plan.stages if stage.rpm > 0.0])
    for values, (least, most), rounded in (
        (pitch, (15.0, 50.0), 0.0),
        (force, (2.0, 12.0), 0.0),
        (depth, (50.0, 1000.0), 0.1),
        (dives, (2, 6), 0.0),
        (rpm, (600.0, 1400.0), 0.0),
    ):
        assert values.min() >= least - rounded
        assert values.max() <= most + rounded
        assert values.min() < least + 0.15 * (most - least)
        assert values.max() > most - 0.15 * (most - least)
    unlike = [len({round(abs(stage.pitch_deg), 6) for stage in glides(flight)}) > 1 for flight in flights()]
    assert 0.2 < np.mean(unlike) < 0.6


def test_water_and_instruments_stay_within_the_stated_ranges_and_fill_them() -> None:
    plans = [flight.plan for flight in flights()]
    for name, values, (least, most) in (
        ("1-sigma of w_w", [plan.vertical_water_std for plan in plans], (0.0, 0.03)),
        ("its correlation time", [plan.vertical_water_time for plan in plans], (100.0, 1000.0)),
        ("pitch noise", [plan.sample_noise["pitch"] for plan in plans], (0.05, 0.5)),
        ("depth noise", [plan.sample_noise["pressure"] for plan in plans], (0.01, 0.10)),
        ("CTD interval", [plan.ctd_s for plan in plans], (1.0, 8.0)),
        ("attitude interval", [plan.attitude_s for plan in plans], (1.0, 8.0)),
        ("share lost", [plan.lost for plan in plans], (0.0, 0.2)),
        ("longest gap", [plan.gap[1] for plan in plans], (40.0, 300.0)),
        ("1-sigma of pitch bias", [flight.pitch_std_deg for flight in flights()], (0.1, 0.5)),
        ("1-sigma of ballast", [flight.ballast_std for flight in flights()], (0.1, 0.5)),
    ):
        assert least <= min(values) < least + 0.1 * (most - least), name
        assert most - 0.1 * (most - least) < max(values) <= most, name
    assert 0.6 < np.mean([flight.located for flight in flights()]) < 0.8


def test_a_fairing_that_the_file_names_is_drawn_flown_and_left_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    stated = vehicle.load("petrel-ii")
    fairing = {
        "carried_water": Coefficient(0.35, 0.1, "1", "a test"),
        "flushing_time": Coefficient(900.0, 300.0, "s", "a test"),
    }
    named = replace(stated, coefficients={**stated.coefficients, **fairing})
    monkeypatch.setattr(fleet, "_load", lambda name: named if name == "petrel-ii" else vehicle.load(name))
    numbers, normal = {"carried_water": 0.7, "flushing_time": -0.5}, fleet.standard_normal
    monkeypatch.setattr(fleet, "standard_normal", lambda seed, again=0: {**normal(seed, again), **numbers})
    flight = next(
        one
        for one in map(plan_of, SEEDS)
        if one.power == "none" and one.plan.vehicle.name == "petrel-ii" and np.ptp(one.plan.water.temperature) > 3.0
    )
    drawn = flight.plan.vehicle
    assert drawn["carried_water"] == pytest.approx(0.35 + 0.07, abs=0.02)  # log-normal
    assert drawn["flushing_time"] == pytest.approx(900.0 - 150.0, abs=60.0)
    truth = run(flight.plan, flight.seed, flight.injection).truth
    sea = Sea.of(flight.plan, truth["depth"].to_numpy())
    hull = sea.net_buoyancy(flight.plan) + flight.injection.buoyancy_offset
    carried = truth["net_buoyancy"] - hull - 9.81 * sea.density * truth["buoyancy_volume"]
    assert np.ptp(carried) > 0.1
    # the weakest orders that are taken leave as much more as the water carried can weigh
    bare = replace(flight.plan, vehicle=drawn.with_values({"carried_water": 0.0}, "a test"))
    taken = [
        next(force for force in np.arange(0.5, 12.0, 0.05) if fleet._carried_out(plan, weak(force), 0.0, 200.0))
        for plan in (bare, flight.plan)
    ]
    column = Sea.of(flight.plan, np.linspace(0.0, 220.0, 60))
    assert taken[1] - taken[0] == pytest.approx(np.ptp(column.carried_weight(flight.plan)), abs=0.06)
    assert taken[1] - taken[0] > 0.1


def weak(force: float) -> fleet._Orders:
    """Return orders of dives and climbs with this net buoyancy, N."""
    return fleet._Orders(-25.0, 25.0, -force, force, 0.0, "none", 0.0, 0.0, 0)


def test_what_has_a_stated_1_sigma_is_drawn_from_the_standard_normal_distribution() -> None:
    names = {name for flight in flights() for name in flight.draws}
    assert {"lift_slope", "parasite_drag", "induced_drag", "thrust_static", "thrust_slope"} <= names
    assert {"compressibility", "thermal_expansion", "pitch_bias", "buoyancy_offset"} <= names
    for name in sorted(names):
        draws = [flight.draws[name] for flight in flights() if name in flight.draws]
        assert kstest(draws, "norm").pvalue > 1e-3, name
    assert kstest([value for flight in flights() for value in flight.draws.values()], "norm").pvalue > 0.01


def test_over_a_cube_the_numbers_of_each_name_are_spread_evenly_and_names_are_independent() -> None:
    numbers = [fleet.standard_normal(seed) for seed in range(3 * fleet.CUBE, 4 * fleet.CUBE)]
    table = np.array([[row[name] for name in sorted(row)] for row in numbers])
    strata = np.sort(np.floor(norm.cdf(table) * fleet.CUBE), axis=0)
    assert (strata == np.arange(fleet.CUBE)[:, None]).all()
    others = np.corrcoef(table, rowvar=False)[~np.eye(table.shape[1], dtype=bool)]
    assert np.abs(others).max() < 5.0 / math.sqrt(fleet.CUBE)
    assert fleet.standard_normal(3 * fleet.CUBE, again=1) != numbers[0]


def test_coefficients_have_the_mean_and_the_1_sigma_of_the_vehicle_file_and_keep_their_sign() -> None:
    craft = vehicle.load("petrel-ii")
    drawn = [fleet.perturbed(craft, fleet.standard_normal(seed)) for seed in range(4000)]
    for name, coefficient in craft.coefficients.items():
        values = np.array([other[name] for other in drawn])
        if coefficient.std == 0.0:
            assert (values == coefficient.value).all(), name
            continue
        assert values.mean() == pytest.approx(coefficient.value, abs=5.0 * coefficient.std / math.sqrt(4000)), name
        assert values.std() == pytest.approx(coefficient.std, rel=0.12), name
        assert coefficient.value == 0.0 or (values * coefficient.value > 0.0).all(), name


def test_pitch_bias_and_ballast_are_off_by_their_draw_times_the_stated_1_sigma() -> None:
    for flight in flights()[:50]:
        assert flight.injection.pitch_bias_deg == flight.draws["pitch_bias"] * flight.pitch_std_deg
        assert flight.injection.buoyancy_offset == flight.draws["buoyancy_offset"] * flight.ballast_std


def test_no_glide_is_ordered_where_the_true_vehicle_has_none() -> None:
    for flight in flights():
        for stage in glides(flight):
            steady = trim_at_pitch(flight.plan.vehicle, stage.net_buoyancy, math.radians(stage.pitch_deg))
            assert np.isfinite(steady.speed), flight.seed
            assert steady.path_angle * stage.net_buoyancy > 0.0, flight.seed


@pytest.mark.parametrize("seed", range(5000, 5008))
def test_a_mission_is_carried_out_and_read_in_fewer_than_20000_records(seed: int) -> None:
    flight, mission = flown(seed)
    surfacings = np.diff(mission.truth["afloat"].astype(int)) > 0
    assert surfacings.sum() == sum(stage.end == "surface" for stage in flight.plan.stages)
    assert 300 < len(mission.records) < 20_000
    # Powered level flight rises and is put back: each of these counts as a dive too.
    assert mission.records["dive"].max() == surfacings.sum() or flight.power == "level"
    assert mission.records["latitude"].notna().any() == flight.located
    assert mission.mission.pitch.std_deg == flight.pitch_std_deg
    assert mission.mission.ballast.std == flight.ballast_std


@pytest.mark.parametrize("seed", range(5000, 5004))
def test_what_flies_is_the_perturbed_vehicle_and_what_is_handed_on_the_file(seed: int) -> None:
    flight, mission = flown(seed)
    craft = flight.plan.vehicle
    assert repr(mission.vehicle) == repr(vehicle.load(craft.name)), "not by ==: what is unknown is NaN"
    truth = mission.truth[~mission.truth["afloat"] & (mission.truth["propeller_speed"] == 0.0)]
    truth = truth[(truth["speed"].diff(20).abs() < 2e-3) & (truth["speed"].diff(-20).abs() < 2e-3)]
    assert len(truth) > 100
    density = Sea.of(flight.plan, truth["depth"].to_numpy()).density
    steady = trim_at_pitch(craft, truth["net_buoyancy"], truth["pitch"], density=density)
    assert np.median(np.abs(truth["speed"] / steady.speed - 1.0)) < 5e-3
    assert np.median(np.abs(truth["angle_of_attack"] - steady.angle_of_attack)) < math.radians(0.1)


def test_the_same_mission_is_flown_again_to_the_last_bit() -> None:
    flight, mission = flown(5001)
    again = fly(flight)
    assert again.records.equals(mission.records)
    assert again.truth.equals(mission.truth)


def test_the_pitch_bias_is_in_the_records() -> None:
    flight, mission = max(
        (flown(seed) for seed in range(5000, 5004)), key=lambda pair: abs(pair[0].injection.pitch_bias_deg)
    )
    known = mission.records[mission.records["pitch"].notna()]
    true = np.interp(seconds(known["time"]), seconds(mission.truth["time"]), mission.truth["pitch"])
    logged = np.degrees(np.median(known["pitch"] - true))
    assert logged == pytest.approx(flight.injection.pitch_bias_deg, abs=0.1)


def test_fairings_carry_water_as_widely_as_the_estimator_takes_it_to_be_open() -> None:
    crafts = [plan_of(seed).plan.vehicle for seed in range(200)]
    share, time = (np.array([craft[name] for craft in crafts]) for name in ("carried_water", "flushing_time"))
    assert np.sqrt(np.mean(share**2)) == pytest.approx(CARRIED_STD, rel=0.05)
    assert share.min() >= 0.0
    assert np.median(time) == pytest.approx(FLUSHING_BEFORE, rel=0.05)
    assert np.std(np.log(time)) == pytest.approx(FLUSHING_STD, rel=0.05)


def test_a_mission_that_its_vehicle_does_not_carry_out_is_drawn_again() -> None:
    with pytest.raises(InputError, match="found not done after"):
        fly(plan_of(16116))
    flight, _ = first_flown(16116)
    assert (flight.seed, flight.again) == (16116, 1)
    assert first_flown(5001)[0].again == 0


def test_a_mission_that_tumbles_up_to_the_surface_is_drawn_again() -> None:
    flight = plan_of(30053)
    climbing = run(flight.plan, flight.seed, flight.injection).truth
    assert fleet.stalled(climbing) > 0.3
    flight, flown = first_flown(30053)
    assert flight.again > 0
    assert fleet.stalled(flown.truth) < fleet.TUMBLING


def test_an_offset_that_would_keep_a_glider_afloat_is_met_by_stronger_orders() -> None:
    lifted = [flight for flight in flights() if flight.injection.buoyancy_offset > 1.0]
    assert lifted
    for flight in lifted:
        for stage in glides(flight):
            if stage.end == "deeper":
                assert stage.net_buoyancy + flight.injection.buoyancy_offset < -fleet.LEAST_FORCE
