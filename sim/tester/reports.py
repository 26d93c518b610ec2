"""What the vehicle says of itself all the time, put together."""

from sim.tester import telemetry
from sim.tester.mission import MissionState
from sim.tester.stand_in import StandIn
from sim.tester.telemetry import Say


def place_reports(vehicle: StandIn, now: float) -> tuple[Say, ...]:
    """Attitude, then place."""
    time_ms = vehicle.time_ms(now)
    return (
        telemetry.attitude(vehicle.pose, time_ms),
        telemetry.position(vehicle.pose, vehicle.home, time_ms),
    )


def regular_reports(vehicle: StandIn, now: float, utc_s: float) -> tuple[Say, ...]:
    """All that is sent regularly, but for what MAVSDK's own plugins send."""
    mission = vehicle.mission
    return (
        telemetry.system_time(utc_s, vehicle.time_ms(now)),
        telemetry.home_position(vehicle.home),
        *place_reports(vehicle, now),
        telemetry.system_status(vehicle.ill, vehicle.percentage),
        telemetry.mission_current(
            mission.current,
            len(mission.items),
            mission.state,
            in_mission=mission.state is MissionState.ACTIVE,
        ),
    )


def observation(vehicle: StandIn) -> Say:
    """What is observed wherever a command is finished."""
    seen = vehicle.observation
    return telemetry.observation(
        seen.resource_id, seen.observed_property, seen.result_value, seen.result_uom
    )
