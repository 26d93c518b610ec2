"""Foreign units against physical constants known in both systems."""

import pytest

from sim.physics import units


def test_a_cubic_foot_of_water_weighs_what_it_should() -> None:
    density_slug_ft3 = 1.940320
    density = density_slug_ft3 * units.KILOGRAMS_M3_PER_SLUG_FT3
    assert density == pytest.approx(1000.0, rel=1e-5)


def test_a_standard_atmosphere() -> None:
    pressure_pa = 2116.2166 * units.PASCALS_PER_PSF
    assert pressure_pa == pytest.approx(101325.0, rel=1e-6)


def test_a_pound_of_force_is_a_slug_foot_per_second_squared() -> None:
    slug_foot = units.KILOGRAMS_PER_SLUG * units.METRES_PER_FOOT
    assert slug_foot == pytest.approx(units.NEWTONS_PER_POUND)


@pytest.mark.parametrize(("rankine", "celsius"), [(491.67, 0.0), (671.67, 100.0), (0.0, -273.15)])
def test_rankine(rankine: float, celsius: float) -> None:
    assert units.celsius_from_rankine(rankine) == pytest.approx(celsius, abs=1e-9)
