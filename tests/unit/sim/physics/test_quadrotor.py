"""The physics: what goes up, what turns which way, what rests."""

import math

import pytest

from sim.config import SimulationConfig
from sim.physics.quadrotor import MotorCommandError, Quadrotor
from sim.physics.truth import Motors, Truth, body_from_ned
from tests.support.messages import said

HOVER = 0.418
RATE_HZ = 500


@pytest.fixture
def quadrotor() -> Quadrotor:
    return Quadrotor(SimulationConfig())


def fly(quadrotor: Quadrotor, motors: Motors, seconds: float) -> Truth:
    quadrotor.command(motors)
    quadrotor.advance(round(seconds * RATE_HZ))
    return quadrotor.truth(0)


def lift_off(quadrotor: Quadrotor) -> Truth:
    return fly(quadrotor, (0.6, 0.6, 0.6, 0.6), 1.5)


def test_it_starts_at_home_on_its_feet_with_its_rotors_stopped(quadrotor: Quadrotor) -> None:
    truth = quadrotor.truth(0)
    assert truth.latitude_deg == pytest.approx(40.4434, abs=1e-7)
    assert truth.longitude_deg == pytest.approx(-3.7382, abs=1e-7)
    assert truth.height_above_home_m == pytest.approx(0.15, abs=0.005)
    assert truth.rotor_rpm == (0.0, 0.0, 0.0, 0.0)
    assert abs(truth.roll_deg) < 0.01
    assert abs(truth.pitch_deg) < 0.5


@pytest.mark.parametrize("heading_deg", [0.5, 90.0, 180.0, 275.0])
def test_it_starts_with_its_nose_to_the_heading(heading_deg: float) -> None:
    truth = Quadrotor(SimulationConfig(heading_deg=heading_deg)).truth(0)
    assert truth.yaw_deg == pytest.approx(heading_deg, abs=0.01)


def test_the_next_vehicle_stands_three_metres_to_the_east() -> None:
    first = Quadrotor(SimulationConfig()).truth(0)
    second = Quadrotor(SimulationConfig(start_east_m=3.0)).truth(0)
    metres_per_degree = 84_800.0  # Of longitude at 40.44 degrees
    east_m = (second.longitude_deg - first.longitude_deg) * metres_per_degree
    assert east_m == pytest.approx(3.0, abs=0.01)
    assert second.latitude_deg == pytest.approx(first.latitude_deg, abs=1e-8)


def test_it_rests_still_for_a_minute(quadrotor: Quadrotor) -> None:
    start = quadrotor.truth(0)
    for _ in range(60):
        truth = fly(quadrotor, (0.0, 0.0, 0.0, 0.0), 1.0)
        assert math.hypot(*truth.velocity_ned) < 1e-5
        assert math.hypot(*truth.rate_frd) < 1e-5
    assert truth.latitude_deg == pytest.approx(start.latitude_deg, abs=1e-8)  # 1 mm
    assert truth.longitude_deg == pytest.approx(start.longitude_deg, abs=1e-8)
    assert truth.height_above_home_m == pytest.approx(start.height_above_home_m, abs=1e-4)


def test_wind_does_not_roll_it_away(quadrotor: Quadrotor) -> None:
    start = quadrotor.truth(0)
    quadrotor.set_wind((10.0, 0.0, 0.0))
    truth = fly(quadrotor, (0.0, 0.0, 0.0, 0.0), 10.0)
    assert truth.latitude_deg == pytest.approx(start.latitude_deg, abs=1e-8)


def test_at_rest_an_accelerometer_would_read_gravity_and_a_gyro_the_earths_rate(
    quadrotor: Quadrotor,
) -> None:
    truth = quadrotor.truth(0)
    assert math.hypot(*truth.specific_force_frd) == pytest.approx(9.800, abs=0.002)
    assert truth.specific_force_frd[2] < -9.79
    north, east, down = truth.inertial_rate_frd
    earth_rate = 7.292115e-5
    latitude = math.radians(40.4434)
    assert north == pytest.approx(earth_rate * math.cos(latitude), rel=0.02)
    assert abs(east) < 1e-6
    assert down == pytest.approx(-earth_rate * math.sin(latitude), rel=0.02)


def test_it_stays_on_the_ground_below_hover(quadrotor: Quadrotor) -> None:
    below = 0.9 * HOVER
    truth = fly(quadrotor, (below, below, below, below), 3.0)
    assert truth.height_above_home_m < 0.17


def test_it_climbs_above_hover_and_falls_with_the_motors_off(quadrotor: Quadrotor) -> None:
    assert lift_off(quadrotor).velocity_ned[2] < -1.0
    fly(quadrotor, (1.0, 1.0, 1.0, 1.0), 2.0)
    top = fly(quadrotor, (0.0, 0.0, 0.0, 0.0), 0.3)
    later = fly(quadrotor, (0.0, 0.0, 0.0, 0.0), 0.3)
    assert later.velocity_ned[2] > top.velocity_ned[2]
    assert abs(later.specific_force_frd[2]) < 9.8


def test_it_neither_climbs_nor_falls_at_hover() -> None:
    quadrotor = Quadrotor(SimulationConfig())
    fly(quadrotor, (HOVER, HOVER, HOVER, HOVER), 3.0)
    # The nose is 0.33 degrees down on the ground, which does not matter here
    assert quadrotor.truth(0).specific_force_frd[2] == pytest.approx(-9.80, abs=0.05)


@pytest.mark.parametrize(
    ("stronger", "axis", "sign"),
    [
        ((1, 2), 0, +1.0),  # Left side: rolls to the right
        ((0, 3), 0, -1.0),  # Right side: rolls to the left
        ((0, 2), 1, +1.0),  # Front: nose up
        ((1, 3), 1, -1.0),  # Rear: nose down
        ((0, 1), 2, +1.0),  # The pair that turns counter-clockwise: nose right
        ((2, 3), 2, -1.0),  # The pair that turns clockwise: nose left
    ],
)
def test_two_stronger_rotors_turn_the_body(
    quadrotor: Quadrotor, stronger: tuple[int, int], axis: int, sign: float
) -> None:
    lift_off(quadrotor)
    commands = [0.6] * 4
    for rotor in stronger:
        commands[rotor] = 0.62
    truth = fly(quadrotor, (commands[0], commands[1], commands[2], commands[3]), 0.2)
    assert sign * truth.rate_frd[axis] > 0.02
    others = [abs(truth.rate_frd[other]) for other in range(3) if other != axis]
    assert max(others) < 0.2 * abs(truth.rate_frd[axis])


@pytest.mark.parametrize("rotor", range(4))
def test_each_command_drives_its_own_rotor(quadrotor: Quadrotor, rotor: int) -> None:
    commands = [0.0] * 4
    commands[rotor] = 0.3
    truth = fly(quadrotor, (commands[0], commands[1], commands[2], commands[3]), 1.0)
    assert [speed > 1000.0 for speed in truth.rotor_rpm] == [index == rotor for index in range(4)]


def test_thrust_follows_a_command_with_its_time_constant(quadrotor: Quadrotor) -> None:
    before = fly(quadrotor, (0.30, 0.30, 0.30, 0.30), 2.0).rotor_rpm[0]
    after = 4868.0  # Steady speed at 0.40 in standing air
    at_time_constant = fly(quadrotor, (0.40, 0.40, 0.40, 0.40), 0.056).rotor_rpm[0]
    assert (at_time_constant - before) / (after - before) == pytest.approx(0.63, abs=0.06)


def test_commands_beyond_the_range_saturate(quadrotor: Quadrotor) -> None:
    other = Quadrotor(SimulationConfig())
    beyond = fly(quadrotor, (7.0, 7.0, -3.0, -3.0), 0.1)
    assert said(beyond) == said(fly(other, (1.0, 1.0, 0.0, 0.0), 0.1))


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
def test_a_command_that_is_no_finite_number_is_refused(quadrotor: Quadrotor, bad: float) -> None:
    with pytest.raises(MotorCommandError):
        quadrotor.command((0.1, 0.1, bad, 0.1))
    assert fly(quadrotor, (0.0, 0.0, 0.0, 0.0), 0.1).rotor_rpm == (0.0, 0.0, 0.0, 0.0)


def test_a_vehicle_that_falls_from_high_up_stays_where_it_hits(quadrotor: Quadrotor) -> None:
    fly(quadrotor, (0.9, 0.9, 0.9, 0.9), 1.0)
    fly(quadrotor, (0.6, 0.3, 0.6, 0.3), 0.5)
    fly(quadrotor, (0.0, 0.0, 0.0, 0.0), 10.0)
    assert quadrotor.wrecked
    lying = quadrotor.truth(0)
    assert 0.0 <= lying.height_above_home_m < 0.22
    assert lying.velocity_ned == (0.0, 0.0, 0.0)
    assert lying.rotor_rpm == (0.0, 0.0, 0.0, 0.0)
    assert math.hypot(*lying.specific_force_frd) == pytest.approx(9.81)
    assert said(fly(quadrotor, (1.0, 1.0, 1.0, 1.0), 2.0)) == said(lying)
    assert quadrotor.motor_power_w() == 0.0


def test_the_accelerometer_feels_the_blow_that_stops_a_wreck(quadrotor: Quadrotor) -> None:
    fly(quadrotor, (0.9, 0.9, 0.9, 0.9), 1.0)
    quadrotor.command((0.0, 0.0, 0.0, 0.0))
    falling = truth = quadrotor.truth(0)
    while not quadrotor.wrecked:
        falling = truth
        quadrotor.advance(1)
        truth = quadrotor.truth(0)
    weight = body_from_ned(truth.q_ned_frd, (0.0, 0.0, -9.81))
    stopped = [0.0, 0.0, 0.0]
    for _ in range(20):
        felt = quadrotor.truth(0).specific_force_frd
        stopped = [s + (f - w) / 500.0 for s, f, w in zip(stopped, felt, weight, strict=True)]
        quadrotor.advance(1)
    velocity = body_from_ned(falling.q_ned_frd, falling.velocity_ned)
    assert math.hypot(*velocity) > 6.0
    assert stopped == pytest.approx([-v for v in velocity], abs=0.1)


def test_a_vehicle_that_tips_over_stays_where_it_lies(quadrotor: Quadrotor) -> None:
    fly(quadrotor, (0.7, 0.0, 0.7, 0.0), 1.0)
    assert quadrotor.wrecked
    assert quadrotor.truth(0).pitch_deg > 50.0
    assert quadrotor.truth(0).height_above_home_m < 0.22


@pytest.mark.parametrize(("height_m", "wrecked"), [(0.5, False), (1.5, False), (3.0, True)])
def test_the_feet_bear_a_firm_landing_but_no_fall(
    monkeypatch: pytest.MonkeyPatch, height_m: float, wrecked: bool
) -> None:
    monkeypatch.setattr("sim.physics.quadrotor._STANDING_HEIGHT_M", height_m)
    dropped = Quadrotor(SimulationConfig())
    assert dropped.wrecked == wrecked
    assert dropped.truth(0).height_above_home_m < 0.22


@pytest.mark.parametrize("wind_m_s", [3.0, 6.0, 10.0])
def test_wind_pushes_a_vehicle_by_rotors_and_body_and_the_accelerometer_feels_it(
    quadrotor: Quadrotor, wind_m_s: float
) -> None:
    lift_off(quadrotor)
    quadrotor.set_wind((-wind_m_s, 0.0, 0.0))
    for _ in range(5):  # JSBSim knows the airspeed one step later
        quadrotor.set_rotor_effects(quadrotor.truth(0))
        quadrotor.advance(2)
    truth = quadrotor.truth(0)
    north, east, down = truth.velocity_ned
    forward, _, _ = body_from_ned(truth.q_ned_frd, (north + wind_m_s, east, down))
    rotors = 0.1 * sum(truth.rotor_rpm) / 5065.0
    body = 0.5 * 1.15 * 0.0161 * truth.airspeed_m_s
    expected = -(rotors + body) * forward / 1.4
    assert forward == pytest.approx(wind_m_s, abs=1.0)
    assert truth.specific_force_frd[0] == pytest.approx(expected, rel=0.02)


def test_hover_draws_what_a_quadrotor_of_its_weight_draws(quadrotor: Quadrotor) -> None:
    fly(quadrotor, (HOVER, HOVER, HOVER, HOVER), 2.0)
    assert 100.0 < quadrotor.motor_power_w() / 1.4 < 160.0  # [W/kg]


def test_the_air_gets_thinner_upwards(quadrotor: Quadrotor) -> None:
    ground = quadrotor.truth(0)
    fly(quadrotor, (0.9, 0.9, 0.9, 0.9), 2.0)
    high = quadrotor.truth(0)
    climbed_m = high.height_above_home_m - ground.height_above_home_m
    assert climbed_m > 5.0
    assert (ground.pressure_pa - high.pressure_pa) / climbed_m == pytest.approx(11.3, abs=0.5)


def test_jsbsim_says_nothing_on_the_console(capfd: pytest.CaptureFixture[str]) -> None:
    quadrotor = Quadrotor(SimulationConfig())
    fly(quadrotor, (0.5, 0.5, 0.5, 0.5), 0.1)
    assert capfd.readouterr() == ("", "")
