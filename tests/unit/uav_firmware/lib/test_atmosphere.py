import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.atmosphere import (
    air_density,
    altitude_from_pressure,
    pressure_from_altitude,
)


@pytest.mark.parametrize(
    ("altitude_m", "pressure_pa"),
    [(0.0, 101325.0), (1000.0, 89874.6), (5000.0, 54019.9), (11000.0, 22632.0)],
)
def test_standard_tables(altitude_m: float, pressure_pa: float) -> None:
    assert pressure_from_altitude(altitude_m) == pytest.approx(pressure_pa, rel=1e-5)


@given(st.floats(-500.0, 11000.0))
def test_altitude_comes_back(altitude_m: float) -> None:
    back = altitude_from_pressure(pressure_from_altitude(altitude_m))
    assert back == pytest.approx(altitude_m, abs=1e-6)


@given(st.floats(20000.0, 110000.0), st.floats(1.0, 1000.0))
def test_less_pressure_is_higher(pressure_pa: float, drop_pa: float) -> None:
    assert altitude_from_pressure(pressure_pa - drop_pa) > altitude_from_pressure(pressure_pa)


@pytest.mark.parametrize("pressure_pa", [0.0, -1.0, math.nan, math.inf])
def test_what_is_no_pressure_is_refused(pressure_pa: float) -> None:
    with pytest.raises(ValueError, match="pressure_pa"):
        altitude_from_pressure(pressure_pa)


@pytest.mark.parametrize("altitude_m", [50_000.0, math.nan, math.inf, -math.inf])
def test_altitudes_outside_the_atmosphere_are_refused(altitude_m: float) -> None:
    with pytest.raises(ValueError, match="altitude_m"):
        pressure_from_altitude(altitude_m)


def test_density_at_sea_level() -> None:
    assert air_density(101325.0, 15.0) == pytest.approx(1.225, abs=1e-3)


@pytest.mark.parametrize("temperature_c", [-300.0, math.nan])
def test_density_needs_a_temperature(temperature_c: float) -> None:
    with pytest.raises(ValueError, match="temperature_c"):
        air_density(101325.0, temperature_c)
