"""Sea water against the check values that TEOS-10 publishes (www.teos-10.org/pubs/gsw/html)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pipeline.findings import InputError
from pipeline.ingest import seawater
from pipeline.mission import Mission, Water
from pipeline.records import Quality

PRESSURE = np.array([10.0, 50.0, 125.0, 250.0, 600.0, 1000.0])
TEMPERATURE = np.array([28.7856, 28.4329, 22.8103, 10.2600, 6.8863, 4.4036])
PACIFIC = seawater.Position(4.0, 188.0)


def test_practical_salinity_gives_the_check_values_of_gsw_sp_from_c() -> None:
    conductivity = np.array([34.5487, 34.7275, 34.8605, 34.6810, 34.5680, 34.5600]) / 10.0
    expected = [20.009869599086951, 20.265511864874270, 22.981513062527689]
    expected += [31.204503263727982, 34.032315787432829, 36.400308494388170]
    found = seawater.sea_water(conductivity, TEMPERATURE, PRESSURE, PACIFIC, "measured")
    np.testing.assert_allclose(found["salinity"], expected, rtol=1e-12)


def test_absolute_salinity_conservative_temperature_and_density_at_the_pressure_give_the_check_values_of_gsw() -> None:
    import gsw

    practical = np.array([34.5487, 34.7275, 34.8605, 34.6810, 34.5680, 34.5600])
    conductivity = gsw.C_from_SP(practical, TEMPERATURE, PRESSURE) / 10.0
    found = seawater.sea_water(conductivity, TEMPERATURE, PRESSURE, PACIFIC, "measured")
    absolute = [34.711778344814114, 34.891522618230098, 35.025544862476920]
    absolute += [34.847229026189588, 34.736628474576051, 34.732363065590846]
    conservative = [28.809919826700281, 28.439227816091140, 22.786176893078498]
    conservative += [10.226189266620782, 6.827213633479988, 4.323575748610455]
    density = [1021.839935738108, 1022.262457966867, 1024.427195413316]
    density += [1027.790152759127, 1029.837779000189, 1032.002453224572]
    np.testing.assert_allclose(found["absolute_salinity"], absolute, rtol=5e-6)  # the atlas of anomalies is revised
    np.testing.assert_allclose(found["conservative_temperature"], conservative, rtol=2e-6)
    np.testing.assert_allclose(found["density"], density, rtol=5e-8)


def test_baltic_salinity_gives_the_check_values_of_gsw_sa_from_sp_baltic() -> None:
    import gsw

    practical = np.array([6.5683, 6.6719, 6.8108, 7.2629, 7.4825, 10.2796])
    expected = [6.669945432342856, 6.773776430742856, 6.912986138057142]
    expected += [7.366094191885713, 7.586183837142856, 10.389520570971428]
    temperature, pressure = np.full(6, 10.0), np.full(6, 20.0)
    conductivity = gsw.C_from_SP(practical, temperature, pressure) / 10.0
    found = seawater.sea_water(conductivity, temperature, pressure, seawater.Position(59.0, 20.0), "baltic")
    np.testing.assert_allclose(found["absolute_salinity"], expected, rtol=1e-10)


def test_depth_gives_the_check_values_of_gsw_z_from_p_and_pressure_its_inverse() -> None:
    expected = [9.9445834469453, 49.7180897012550, 124.2726219409978]
    expected += [248.4700576548589, 595.8253480356214, 992.0919060719987]
    np.testing.assert_allclose(seawater.depth(PRESSURE, 4.0), expected, rtol=1e-10)
    np.testing.assert_allclose(seawater.pressure(np.array(expected), 4.0), PRESSURE, rtol=1e-9)


@pytest.mark.parametrize(("salinity", "temperature"), [(0.0, 20.0), (7.5, 8.0), (33.0, 28.0), (35.16504, 0.0)])
def test_depth_is_that_of_the_weight_of_the_water_above(salinity: float, temperature: float) -> None:
    """A column of one water: dp = ρ g dz, integrated here, not by gsw."""
    import gsw

    pressure = np.linspace(0.0, 500.0, 2001)
    density = gsw.rho(salinity, temperature, pressure)
    weight = density * gsw.grav(45.0, pressure)
    expected = np.concatenate([[0.0], np.cumsum(np.diff(pressure) * 1e4 * 0.5 * (1 / weight[1:] + 1 / weight[:-1]))])
    found = seawater.depth(pressure, 45.0, (pressure, density))
    np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-3)
    assert seawater.depth(pressure, 45.0, (pressure, np.full(2001, np.nan))) == pytest.approx(
        seawater.depth(pressure, 45.0)
    )


def test_a_ctd_without_pressure_of_its_own_still_weighs_the_water() -> None:
    time = np.arange(0.0, 400.0)
    pressure = np.where(time % 2 == 0, time / 4.0, np.nan)
    density = np.where(time % 2 == 1, 1000.0, np.nan)
    table = pd.DataFrame({"time": time, "pressure": pressure, "density": density})
    found = seawater.with_depth(table, 45.0)["depth"].to_numpy()
    assert np.isnan(found[1::2]).all()
    assert found[200] == pytest.approx(50.0 * 1e4 / (1000.0 * 9.8062), rel=1e-3)
    assert seawater.with_depth(table.drop(columns="density"), 45.0)["depth"][200] == pytest.approx(49.58, abs=0.02)


def test_fresh_water_needs_no_conductivity_and_is_heaviest_at_four_degrees() -> None:
    found = seawater.sea_water(None, np.array([0.5, 4.0, 20.0]), np.zeros(3), PACIFIC, "fresh")
    assert found["density"] == pytest.approx([999.87, 999.97, 998.21], abs=0.02)  # CIPM tables
    assert found["salinity"] == pytest.approx(0.0)


def test_without_longitude_the_reference_salinity_is_taken() -> None:
    found = seawater.sea_water(
        np.array([4.29140]), np.array([15.0 / 1.00024]), np.array([0.0]), seawater.Position(45.0, np.nan), "measured"
    )
    assert found["absolute_salinity"] == pytest.approx(35.16504, abs=1e-3)  # C(35, 15 °C IPTS-68, 0)


def _ctd(**columns: object) -> pd.DataFrame:
    frame = pd.DataFrame(
        {"time": np.arange(3.0) + 1.5e9, "pressure": [10.0, 20.0, 30.0], "temperature": 10.0, **columns}
    )
    frame.attrs = {"name": "ctd.csv"}
    return frame


def test_samples_that_are_no_sea_water_have_no_density_and_are_counted() -> None:
    mission = Mission(vehicle="petrel-ii", latitude=45.0, longitude=-30.0)
    (frame,), findings = seawater.with_sea_water(mission, [_ctd(conductivity=[3.8, 9.0, 3.8])])
    assert np.isnan(frame["density"].to_numpy()).tolist() == [False, True, False]
    assert [str(finding) for finding in findings] == [
        "ctd.csv: record 2: found 1 of 3 samples that are no sea water, first temperature 10, conductivity 9, "
        "pressure 20; expected values inside the oceanographic funnel of TEOS-10; their density is left out"
    ]


def test_borrowed_water_is_a_line_in_pressure_and_said_to_be_borrowed() -> None:
    water = Water(density=1028.0, density_per_dbar=0.005, std=0.5, temperature=18.0, temperature_per_dbar=-0.01)
    mission = Mission(vehicle="slocum-thruster", water=water)
    table = pd.DataFrame({"time": np.arange(3.0), "pressure": [0.0, np.nan, 200.0]})
    found, (note,) = seawater.with_borrowed_water(mission, table)
    np.testing.assert_allclose(found["density"], [1028.0, np.nan, 1029.0])
    np.testing.assert_allclose(found["temperature"], [18.0, np.nan, 16.0])
    assert str(note) == (
        "mission.yaml: water: found no CTD; expected a measured density; water is borrowed, not measured: "
        "1028 kg/m3 + 0.005 kg/m3/dbar, 1-sigma 0.5; 18 degC + -0.01 K/dbar"
    )


def test_without_a_ctd_the_lack_of_density_is_told_unless_water_is_lent() -> None:
    frame = pd.DataFrame({"time": np.arange(3.0), "pressure": [0.0, 100.0, 200.0]})
    frame.attrs = {"name": "nav.csv"}
    lent = Mission(vehicle="slocum-thruster", latitude=36.0, water=Water(density=1028.0))
    assert seawater.with_sea_water(lent, [frame])[1] == []
    assert [str(told) for told in seawater.with_sea_water(lent.model_copy(update={"water": None}), [frame])[1]] == [
        "mission: density: found no record with temperature, conductivity and pressure; expected a CTD; "
        "there is no density"
    ]


def test_a_measured_density_or_temperature_is_never_overwritten() -> None:
    mission = Mission(vehicle="slocum-thruster", water=Water(density=1028.0, temperature=18.0, source="an atlas"))
    table = pd.DataFrame({"pressure": [5.0], "temperature": [11.0], "density": [1026.0]})
    found, (note,) = seawater.with_borrowed_water(mission, table)
    pd.testing.assert_frame_equal(found, table)
    assert str(note) == "mission.yaml: water: found a density, though a CTD measured one; not used"
    found, (note,) = seawater.with_borrowed_water(mission, table.drop(columns="density"))
    assert found["temperature"].tolist() == [11.0]
    assert str(note).endswith("1028 kg/m3 + 0.0045 kg/m3/dbar, 1-sigma 1 (an atlas)")


def test_without_a_word_of_water_nothing_is_borrowed() -> None:
    table = pd.DataFrame({"pressure": [5.0]})
    assert seawater.with_borrowed_water(Mission(vehicle="slocum-thruster"), table)[1] == []


def test_a_flagged_pressure_does_not_enter_density() -> None:
    flags = np.array([Quality.GOOD, Quality.BAD, Quality.PROBABLY_GOOD], dtype=np.int8)
    mission = Mission(vehicle="petrel-ii", latitude=45.0, longitude=-30.0)
    (frame,), findings = seawater.with_sea_water(mission, [_ctd(conductivity=3.8, pressure_qc=flags)])
    assert np.isnan(frame["density"].to_numpy()).tolist() == [False, True, False]
    assert findings == []


def test_pressure_interpolated_to_the_ctd_serves_density_and_goes_no_further() -> None:
    frame = _ctd(conductivity=3.8).rename(columns={"pressure": "pressure_interpolated"})
    mission = Mission(vehicle="petrel-ii", latitude=45.0, longitude=-30.0)
    (found,), _ = seawater.with_sea_water(mission, [frame])
    (reference,), _ = seawater.with_sea_water(mission, [_ctd(conductivity=3.8)])
    assert found["density"].tolist() == reference["density"].tolist()
    assert "pressure_interpolated" not in found
    assert "pressure" not in found


def test_position_is_the_median_fix_where_mission_yaml_has_none() -> None:
    fixes = pd.DataFrame(
        {"time": [0.0, 1.0, 2.0, 3.0], "latitude": [10.0, 11.0, 12.0, 0.0], "longitude": [5.0, 6.0, 7.0, 0.0]}
    )
    place, findings = seawater.position(Mission(vehicle="petrel-ii"), [fixes])
    assert place == seawater.Position(11.0, 6.0)
    assert findings == []


def test_position_is_as_mission_yaml_says_and_far_from_the_fixes_it_is_told() -> None:
    fixes = pd.DataFrame({"time": [0.0, 1.0], "latitude": [10.0, 12.0], "longitude": [5.0, 7.0]})
    near, nothing = seawater.position(Mission(vehicle="petrel-ii", latitude=12.0, longitude=7.0), [fixes])
    assert near == seawater.Position(12.0, 7.0)
    assert nothing == []
    far, findings = seawater.position(Mission(vehicle="petrel-ii", latitude=-11.0), [fixes])
    assert far == seawater.Position(-11.0, 6.0)
    assert [str(finding) for finding in findings] == [
        "mission.yaml: latitude: found -11° N and fixes around 11.0° N; expected the latitude of the fixes; "
        "that of mission.yaml is used for gravity, depth and salinity"
    ]


def test_without_any_position_forty_five_degrees_are_taken_and_said() -> None:
    place, findings = seawater.position(Mission(vehicle="petrel-ii"), [])
    assert place.latitude == 45.0
    assert [str(finding) for finding in findings] == [
        "mission.yaml: latitude: found no latitude and no GPS fix; expected one of them; "
        "45° taken: depth is wrong by up to 0.3 %"
    ]


def test_baltic_salinity_elsewhere_is_refused() -> None:
    mission = Mission(vehicle="petrel-ii", salinity="baltic", latitude=45.0, longitude=-30.0)
    with pytest.raises(InputError) as error:
        seawater.with_sea_water(mission, [_ctd(conductivity=3.8)])
    assert str(error.value) == (
        "mission.yaml: salinity: found 'baltic' and 45.00° N -30.00° E; expected a position in the Baltic Sea; "
        "give latitude and longitude, or salinity: measured"
    )


def test_depth_becomes_pressure_and_salinity_becomes_conductivity() -> None:
    frame = pd.DataFrame(
        {"time": np.arange(6.0), "depth": [9.9445834469453] * 6, "temperature": 28.7856, "salinity": 20.009869599086951}
    )
    frame.attrs = {"name": "ctd.csv"}
    (found,), findings = seawater.pressure_and_conductivity(Mission(vehicle="petrel-ii", latitude=4.0), [frame])
    assert found["pressure"].to_numpy() == pytest.approx(10.0, rel=1e-9)
    assert found["conductivity"].to_numpy() == pytest.approx(3.45487, rel=1e-9)
    assert len(findings) == 2


def test_depth_beside_a_pressure_in_the_wrong_unit_gives_it_away() -> None:
    depth = np.linspace(5.0, 100.0, 20)
    frame = pd.DataFrame({"time": np.arange(20.0), "depth": depth, "pressure": depth / 10.0})
    frame.attrs = {"name": "ctd.csv", "columns": {"pressure": "P"}}
    with pytest.raises(InputError) as error:
        seawater.pressure_and_conductivity(Mission(vehicle="petrel-ii", latitude=45.0), [frame])
    assert str(error.value) == (
        "ctd.csv: column 'P': found a pressure 0.0992 times what the depth in the same file means; expected 1; "
        "correct the unit of pressure or depth under files: in mission.yaml"
    )


def test_a_depth_that_no_ocean_has_costs_its_record() -> None:
    found = seawater.pressure(np.array([10.0, -6.0, np.nan, 1e30, np.inf, -1.0]), 45.0)
    np.testing.assert_allclose(found, [10.08, -6.0, np.nan, 1e30, np.inf, -1.008], rtol=1e-3)
    np.testing.assert_allclose(
        seawater.depth(np.array([10.08, 1e30, np.nan, np.inf, -1.0]), 45.0),
        [10.0, np.nan, np.nan, np.nan, -0.99],
        rtol=1e-2,
    )


def test_a_pressure_beyond_the_deepest_trench_does_not_ask_for_layers_down_to_it() -> None:
    pressure = np.array([10.0, 20.0, 1e19, np.nan])
    found = seawater.depth(pressure, 45.0, (pressure, np.full(4, 1027.0)))
    np.testing.assert_allclose(found, [9.93, 19.86, np.nan, np.nan], rtol=1e-3)
