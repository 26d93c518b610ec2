"""A configuration is whole and in range, or it is refused by the name of its field."""

import pytest

from sim.config import SimulationConfig, SimulationConfigError, start_east_m


def test_the_default_home_is_the_farm() -> None:
    config = SimulationConfig()
    assert (config.home_latitude_deg, config.home_longitude_deg) == (40.44340, -3.73820)
    assert config.home_altitude_amsl_m == 650.0
    assert config.heading_deg == 0.0


def test_a_control_step_lasts_the_inverse_of_the_rate() -> None:
    assert SimulationConfig(control_rate_hz=250).step_us == 4000
    assert SimulationConfig(control_rate_hz=500).step_us == 2000


def test_home_may_be_the_shore_of_the_dead_sea() -> None:
    assert SimulationConfig(home_altitude_amsl_m=-430.0).home_altitude_amsl_m == -430.0


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("home_latitude_deg", 91.0),
        ("home_longitude_deg", float("nan")),
        ("home_altitude_amsl_m", float("inf")),
        ("seed", -1),
        ("physics_rate_hz", 250),
        ("control_rate_hz", 0),
        ("wind_speed_m_s", -1.0),
        ("wind_from_deg", float("nan")),
        ("sensor_noise_factor", -0.1),
        ("battery_capacity_ah", 0.0),
        ("battery_initial_charge", 1.1),
        ("gps", "m10"),
    ],
)
def test_a_value_out_of_range_is_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(SimulationConfigError, match=field):
        SimulationConfig(**{field: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(("physics", "control"), [(500, 300), (900, 300)])
def test_control_must_fit_into_physics_and_into_microseconds(physics: int, control: int) -> None:
    with pytest.raises(SimulationConfigError, match="control_rate_hz"):
        SimulationConfig(physics_rate_hz=physics, control_rate_hz=control)


def test_vehicles_stand_three_metres_apart_to_the_east() -> None:
    assert [start_east_m(number) for number in (1, 2, 3)] == [0.0, 3.0, 6.0]


def test_there_is_no_vehicle_zero() -> None:
    with pytest.raises(SimulationConfigError, match="vehicle_number"):
        start_east_m(0)
