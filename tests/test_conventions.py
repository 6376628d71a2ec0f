"""Coefficients of Seaglider and of Slocum against the laws they were published with, there and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import conventions, vehicle


def test_slocum_file_holds_the_numbers_of_merckelbach_2010_and_2019() -> None:
    slocum = vehicle.load("slocum-g2")
    half_rho_s = 0.5 * slocum["reference_density"] * 0.1
    aspect, sweep = 7.0, math.radians(43.0)
    a_w = 2.0 * math.pi * aspect / (2.0 + math.sqrt(aspect**2 * (1.0 + math.tan(sweep) ** 2) + 4.0))
    assert a_w == pytest.approx(3.734, abs=5e-4)
    assert conventions.wing_lift_slope() == pytest.approx(a_w, rel=1e-15)
    c_d1 = 9.7 + a_w**2 / (math.pi * 0.8 * aspect)
    assert c_d1 == pytest.approx(10.49, abs=5e-3)
    assert slocum["lift_slope"] == pytest.approx(half_rho_s * (3.8 + a_w), rel=2e-5)
    assert slocum["parasite_drag"] == pytest.approx(half_rho_s * 0.15, rel=2e-5)
    assert slocum["induced_drag"] == pytest.approx(half_rho_s * c_d1, rel=2e-5)
    assert slocum["mass_forward"] == pytest.approx(1.2 * slocum["mass"])
    assert slocum["mass_normal"] == pytest.approx(1.92 * slocum["mass"])
    assert slocum["compressibility"] == 5e-10


def eriksen(a: float, b: float, c: float, s: float, speed: float, alpha: float) -> tuple[float, float]:
    """Return lift and drag in N as Eriksen et al. (2001) write them, α in rad, ρ = 1027.5 kg/m³, l = 1.8 m."""
    q = 0.5 * 1027.5 * speed**2
    degrees = math.degrees(alpha)
    return q * 1.8**2 * a * degrees, q * 1.8**2 * (b * q**s + c * degrees**2)


@pytest.mark.parametrize(
    ("name", "a", "b", "c", "s"),
    [
        ("seaglider", 0.003836, 0.010078, 9.85e-6, -0.25),
        ("seaglider-sgx", 0.00355, 0.0034, 5.7e-6, 0.0),
    ],
)
@pytest.mark.parametrize("speed", [0.15, 0.27, 0.6])
@pytest.mark.parametrize("alpha", [-0.06, 0.0, 0.03])
def test_seaglider_files_give_the_forces_of_eriksen_2001(
    name: str, a: float, b: float, c: float, s: float, speed: float, alpha: float
) -> None:
    polar = vehicle.load(name).polar
    lift, drag = eriksen(a, b, c, s, speed, alpha)
    assert polar.lift_slope * alpha * speed**2 == pytest.approx(lift, rel=3e-5)
    here = polar.parasite_drag * speed ** (2.0 + polar.drag_exponent) + polar.induced_drag * alpha**2 * speed**2
    assert here == pytest.approx(drag, rel=3e-5)


@given(
    a=st.floats(7e-4, 7e-3),
    b=st.floats(2e-3, 3e-2),
    c=st.floats(1e-6, 5e-5),
    s=st.sampled_from([-0.25, -0.3, 0.0]),
    speed=st.floats(0.05, 1.0),
    alpha=st.floats(-0.2, 0.2),
)
def test_constants_of_a_seaglider_file_give_the_forces_of_eriksen_2001(
    a: float, b: float, c: float, s: float, speed: float, alpha: float
) -> None:
    constants = {"hd_a": a, "hd_b": b, "hd_c": c, "hd_s": s, "glider_length": 1.8}
    polar = conventions.from_seaglider(vehicle.load("seaglider"), constants, source="a dive").polar
    lift, drag = eriksen(a, b, c, s, speed, alpha)
    assert polar.lift_slope * alpha * speed**2 == pytest.approx(lift, rel=1e-12, abs=1e-300)
    here = polar.parasite_drag * speed ** (2.0 + polar.drag_exponent) + polar.induced_drag * alpha**2 * speed**2
    assert here == pytest.approx(drag, rel=1e-12)


def test_constants_missing_in_a_seaglider_file_leave_the_vehicle_as_it_was() -> None:
    base = vehicle.load("seaglider")
    assert conventions.from_seaglider(base, {}, source="a dive").coefficients == base.coefficients
    changed = conventions.from_seaglider(
        base, {"mass": 56.69, "abs_compress": 2.6e-6, "therm_expan": 7e-5, "temp_ref": 10.0}, source="a dive"
    )
    assert changed["mass"] == 56.69
    assert changed["compressibility"] == pytest.approx(2.6e-10)
    assert changed["thermal_expansion"] == 7e-5
    assert changed["reference_temperature"] == 10.0
    assert changed.polar == base.polar
    assert changed.std("compressibility") / changed["compressibility"] == pytest.approx(1.0 / 4.2)


SLOCUM = {"C_D0": 0.15, "C_D1": 9.7 + 3.73427**2 / (math.pi * 0.8 * 7.0), "a_h": 3.8, "a_w": 3.73427, "S": 0.1}


@pytest.mark.parametrize("name", ["slocum-g2", "slocum-deep", "slocum-thruster"])
def test_slocum_files_are_their_published_coefficients(name: str) -> None:
    published = conventions.to_slocum(vehicle.load(name))
    assert published == pytest.approx(SLOCUM, rel=2e-5)
    there = conventions.from_slocum(vehicle.load(name), SLOCUM, source="Merckelbach et al. 2019")
    assert tuple(there.polar) == pytest.approx(tuple(vehicle.load(name).polar), rel=2e-5)


@given(
    c_d0=st.floats(0.05, 0.5),
    c_d1=st.floats(1.0, 20.0),
    a_h=st.floats(0.5, 6.0),
    a_w=st.floats(2.0, 5.0),
    area=st.floats(0.05, 0.3),
    density=st.floats(1000.0, 1050.0),
    speed=st.floats(0.05, 1.0),
    alpha=st.floats(-0.2, 0.2),
)
def test_coefficients_of_slocum_give_its_forces_and_come_back(
    c_d0: float, c_d1: float, a_h: float, a_w: float, area: float, density: float, speed: float, alpha: float
) -> None:
    constants = {"C_D0": c_d0, "C_D1": c_d1, "a_h": a_h, "a_w": a_w, "S": area}
    there = conventions.from_slocum(vehicle.load("seaglider"), constants, reference_density=density, source="a paper")
    pressure = 0.5 * density * speed**2 * area
    assert there["lift_slope"] * alpha * speed**2 == pytest.approx(
        pressure * (a_h + a_w) * alpha, rel=1e-12, abs=1e-300
    )
    drag = there["parasite_drag"] * speed**2 + there["induced_drag"] * alpha**2 * speed**2
    assert drag == pytest.approx(pressure * (c_d0 + c_d1 * alpha**2), rel=1e-12)
    assert there["drag_exponent"] == 0.0
    assert conventions.to_slocum(there, area=area, wings=a_w) == pytest.approx(constants, rel=1e-12)


@given(
    a=st.floats(0.0005, 0.006),
    b=st.floats(0.002, 0.02),
    c=st.floats(1e-6, 2e-5),
    s=st.floats(-0.5, 0.0),
    length=st.floats(1.0, 3.0),
)
def test_constants_of_seaglider_come_back(a: float, b: float, c: float, s: float, length: float) -> None:
    constants = {"hd_a": a, "hd_b": b, "hd_c": c, "hd_s": s, "glider_length": length}
    there = conventions.from_seaglider(vehicle.load("seaglider"), constants, source="a dive")
    assert conventions.to_seaglider(there, glider_length=length) == pytest.approx(constants, rel=1e-12)


def test_slocum_without_one_of_its_constants_is_refused() -> None:
    with pytest.raises(KeyError, match="C_D1"):
        conventions.from_slocum(vehicle.load("slocum-g2"), {"C_D0": 0.15, "a_h": 3.8, "a_w": 3.7, "S": 0.1}, source="x")


def test_what_a_law_cannot_say_is_refused() -> None:
    lifting = vehicle.load("slocum-g2").with_values({"lift_at_zero": 1.0}, "a wing set at an angle")
    with pytest.raises(ValueError, match="slocum-g2: found lift_at_zero 1; Slocum's law has none"):
        conventions.to_slocum(lifting)
    with pytest.raises(ValueError, match="slocum-g2: found lift_at_zero 1; Seaglider's law has none"):
        conventions.to_seaglider(lifting)
    with pytest.raises(ValueError, match=r"seaglider: found drag_exponent -0\.5; Slocum's law has none"):
        conventions.to_slocum(vehicle.load("seaglider"))
