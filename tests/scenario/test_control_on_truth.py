"""Control without an estimator: the laws fly the airframe on its true state."""

import math

import pytest

from sim.config import SimulationConfig
from tests.support.control_bench import ControlBench, Trajectory
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import LandedState
from uav_firmware.msg.vectors import Vector3

pytestmark = pytest.mark.scenario

NAN = float("nan")
ZERO: Vector3 = (0.0, 0.0, 0.0)
HOVER: Vector3 = (0.0, 0.0, -5.0)


def ease(share: float) -> Vector3:
    """Fifth-order ease from 0 to 1 with its first and second derivative."""
    u = min(max(share, 0.0), 1.0)
    return (
        u**3 * (10.0 - 15.0 * u + 6.0 * u * u),
        30.0 * u * u * (1.0 - u) ** 2,
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
    )


def leg(bench: ControlBench, start: Vector3, end: Vector3, seconds: float) -> Trajectory:
    """A straight leg from rest to rest that begins now."""
    begin_s = bench.time_s

    def setpoint(time_s: float, _position: Vector3) -> TrajectorySetpoint:
        way, speed, acceleration = ease((time_s - begin_s) / seconds)
        span = [b - a for a, b in zip(start, end, strict=True)]
        position = [a + way * d for a, d in zip(start, span, strict=True)]
        velocity = [speed * d / seconds for d in span]
        push = [acceleration * d / seconds**2 for d in span]
        return TrajectorySetpoint(
            time_us=bench.vehicle.time_us,
            position_ned=(position[0], position[1], position[2]),
            velocity_ned=(velocity[0], velocity[1], velocity[2]),
            acceleration_ned=(push[0], push[1], push[2]),
            yaw=0.0,
            yaw_rate=0.0,
        )

    return setpoint


def descent(bench: ControlBench) -> Trajectory:
    return lambda _time_s, _position: TrajectorySetpoint(
        bench.vehicle.time_us, (0.0, 0.0, NAN), (0.0, 0.0, 0.5), ZERO, NAN, 0.0
    )


def airborne(config: SimulationConfig | None = None, **parameters: float) -> ControlBench:
    """A vehicle that hovers five metres above its start."""
    bench = ControlBench(config)
    for name, value in parameters.items():
        bench.registry.set(name, value)
    bench.set_armed(armed=True)
    bench.run(1.2, leg(bench, ZERO, ZERO, 1.0))
    bench.run(8.0, leg(bench, ZERO, HOVER, 5.0))
    return bench


def farthest_from(bench: ControlBench, place: Vector3, seconds: float) -> float:
    """Largest true distance [m] from a commanded place."""
    distances: list[float] = []
    bench.run(
        seconds,
        leg(bench, place, place, 1.0),
        watch=lambda: distances.append(math.dist(bench.position_ned, place)),
    )
    return max(distances)


def test_a_leg_of_20_m_at_5_m_s_is_tracked_without_overshoot() -> None:
    bench = airborne()
    end = (20.0, 0.0, -5.0)
    sideways: list[float] = []
    bench.run(
        7.5,
        leg(bench, HOVER, end, 7.5),
        watch=lambda: sideways.append(
            math.hypot(bench.position_ned[1], bench.position_ned[2] + 5.0)
        ),
    )
    assert max(sideways) < 0.05
    north: list[float] = []
    bench.run(3.0, leg(bench, end, end, 1.0), watch=lambda: north.append(bench.position_ned[0]))
    # The integral that has held the rotors' drag at 5 m/s, 1.5 m/s^2, has yet to be given up
    assert max(north) < 20.2
    assert bench.position_ned == pytest.approx(end, abs=0.10)


@pytest.mark.parametrize("hover_thrust", [0.16, 0.30])
def test_a_hover_thrust_wrong_by_a_third_still_holds_height(hover_thrust: float) -> None:
    bench = airborne(MPC_THR_HOVER=hover_thrust)
    assert farthest_from(bench, HOVER, 5.0) < 0.10


def test_it_stands_still_in_the_air() -> None:
    assert farthest_from(airborne(), HOVER, 5.0) < 0.03


def test_gusty_wind_is_held_off() -> None:
    bench = airborne(SimulationConfig(wind_speed_m_s=8.0, sensor_noise_factor=0.0))
    assert farthest_from(bench, HOVER, 10.0) < 0.25


def test_it_lands_softly_and_knows_it() -> None:
    bench = airborne()
    touch_down_speed = [0.0]

    def watch() -> None:
        if bench.position_ned[2] < -0.03:
            touch_down_speed[0] = bench.truth.velocity_ned[2]

    bench.run(15.0, descent(bench), watch)
    assert bench.landed_state is LandedState.ON_GROUND
    assert touch_down_speed[0] < 0.7
    assert not bench.simulation.wrecked
    assert max(bench.truth.rotor_rpm) < 1000.0


def test_an_armed_vehicle_without_control_descends() -> None:
    bench = airborne()
    last = leg(bench, HOVER, HOVER, 1.0)(bench.time_s, HOVER)
    bench.run(14.0, lambda _time_s, _position: last)
    assert bench.landed_state is LandedState.ON_GROUND
    assert not bench.simulation.wrecked


def test_armed_on_the_ground_it_stays_there() -> None:
    bench = ControlBench()
    bench.set_armed(armed=True)
    assert farthest_from(bench, ZERO, 5.0) < 0.01
    assert bench.landed_state is LandedState.ON_GROUND


def test_disarmed_motors_stand() -> None:
    bench = ControlBench()
    bench.run(2.0, leg(bench, ZERO, HOVER, 1.0))
    assert bench.truth.rotor_rpm == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1.0)


def test_disarming_in_the_air_stops_the_motors() -> None:
    bench = airborne()
    bench.set_armed(armed=False)
    bench.run(0.02, leg(bench, HOVER, HOVER, 1.0))
    motors = bench.motors.value
    assert motors is not None
    assert motors.control == (0.0, 0.0, 0.0, 0.0)
