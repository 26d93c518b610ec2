"""A hover ends with a landing or a takeover, and is found again at its noted place."""

import pytest

from mavlink_broker.autopilots.families import ModeRole
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.control_authority import ObservedMode
from mavlink_broker.vehicle.recovery_state import AS_HIGH_WITHIN_M, WITHIN_M, Hover, Pose
from mavlink_broker.vehicle.telemetry import Position, Snapshot

PLACE = Position(latitude_deg=58.0, longitude_deg=15.0, altitude_m=30.0, speed_m_s=0.0)
NOTED = Pose(58.0, 15.0, 30.0)
METRE_DEG = 1.0 / 111_320.0
HOLD = ObservedMode("AUTO.LOITER", ModeRole.HOLD, armed=True)
PILOT = ObservedMode("POSCTL", ModeRole.OTHER, armed=True)


def airborne(north_m: float = 0.0, up_m: float = 0.0) -> Snapshot:
    position = PLACE._replace(
        latitude_deg=PLACE.latitude_deg + north_m * METRE_DEG, altitude_m=PLACE.altitude_m + up_m
    )
    in_air = mavlink.MAV_LANDED_STATE_IN_AIR
    return Snapshot(armed=True, position=position, landed_state=in_air)


def test_it_notes_the_place_and_lasts_while_the_vehicle_holds() -> None:
    hover = Hover()
    hover.begin(PLACE)
    hover.update(airborne(north_m=5.0), HOLD, is_identified=True)
    assert hover.is_held
    assert hover.place == NOTED


@pytest.mark.parametrize(("armed", "mode"), [(False, HOLD), (True, PILOT)])
def test_it_ends_with_a_landing_or_a_takeover(*, armed: bool, mode: ObservedMode) -> None:
    hover = Hover()
    hover.begin(PLACE)
    hover.update(Snapshot(armed=armed, position=PLACE), mode, is_identified=True)
    assert not hover.is_held
    assert hover.place is None


@pytest.mark.parametrize(
    ("snapshot", "mode", "is_found"),
    [
        (airborne(), HOLD, True),
        (airborne(north_m=WITHIN_M - 1.0), HOLD, True),
        (airborne(north_m=WITHIN_M + 1.0), HOLD, False),
        (airborne(up_m=AS_HIGH_WITHIN_M + 1.0), HOLD, False),
        (airborne(), PILOT, False),
    ],
)
def test_a_restarted_broker_finds_it_at_the_noted_place_only(
    snapshot: Snapshot, mode: ObservedMode, *, is_found: bool
) -> None:
    hover = Hover()
    hover.recall(NOTED)
    hover.update(snapshot, mode, is_identified=True)
    assert hover.is_held is is_found
    assert (hover.place is not None) is is_found


def test_the_noted_place_waits_for_the_identity_and_the_position_of_the_vehicle() -> None:
    hover = Hover()
    hover.recall(NOTED)
    hover.update(airborne(), HOLD, is_identified=False)
    hover.update(Snapshot(armed=True), HOLD, is_identified=True)
    assert not hover.is_held
    assert hover.place == NOTED
