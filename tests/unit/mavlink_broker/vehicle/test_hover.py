"""A hover ends with a landing or a takeover, and is found again at its noted place."""

import pytest

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.planning.situation import Pose
from mavlink_broker.vehicle.control_authority import (
    AS_HIGH_WITHIN_M,
    HOVERS_WITHIN_M,
    Hover,
    ObservedMode,
)
from mavlink_broker.vehicle.telemetry import MissionNow, Position, Snapshot

PLACE = Position(latitude_deg=58.0, longitude_deg=15.0, altitude_m=30.0, speed_m_s=0.0)
NOTED = Pose(58.0, 15.0, 30.0)
METRE_DEG = 1.0 / 111_320.0
HOLD = ObservedMode("AUTO.LOITER", ModeRole.HOLD, armed=True)
PILOT = ObservedMode("POSCTL", ModeRole.OTHER, armed=True)
AUTO = ObservedMode("AUTO", ModeRole.MISSION, armed=True)
BRAKE = ObservedMode("BRAKE", ModeRole.PAUSED, armed=True)
COMPLETE = MissionNow(seq=4, state=mavlink.MISSION_STATE_COMPLETE, mission_id=7)
ACTIVE = MissionNow(seq=1, state=mavlink.MISSION_STATE_ACTIVE, mission_id=7)
NONE = MissionNow(seq=0, state=mavlink.MISSION_STATE_NO_MISSION, mission_id=0)
UNKNOWN = MissionNow(seq=4, state=mavlink.MISSION_STATE_UNKNOWN, mission_id=0)


def airborne(
    north_m: float = 0.0, up_m: float = 0.0, mission: MissionNow | None = None
) -> Snapshot:
    position = PLACE._replace(
        latitude_deg=PLACE.latitude_deg + north_m * METRE_DEG, altitude_m=PLACE.altitude_m + up_m
    )
    in_air = mavlink.MAV_LANDED_STATE_IN_AIR
    return Snapshot(armed=True, position=position, landed_state=in_air, mission=mission)


def test_it_notes_the_place_and_lasts_while_the_vehicle_holds() -> None:
    hover = Hover()
    hover.begin(airborne(), HOLD)
    hover.update(airborne(north_m=5.0), HOLD, is_identified=True)
    assert hover.is_held
    assert hover.place == NOTED


@pytest.mark.parametrize(("armed", "mode"), [(False, HOLD), (True, PILOT)])
def test_it_ends_with_a_landing_or_a_takeover(*, armed: bool, mode: ObservedMode) -> None:
    hover = Hover()
    hover.begin(airborne(), HOLD)
    hover.update(Snapshot(armed=armed, position=PLACE), mode, is_identified=True)
    assert not hover.is_held
    assert hover.place is None


@pytest.mark.parametrize(
    ("snapshot", "mode", "is_found"),
    [
        (airborne(), HOLD, True),
        (airborne(north_m=HOVERS_WITHIN_M - 1.0), HOLD, True),
        (airborne(north_m=HOVERS_WITHIN_M + 1.0), HOLD, False),
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


@pytest.mark.parametrize(
    ("began", "now", "is_held"),
    [
        ((HOLD, COMPLETE), (HOLD, COMPLETE), True),
        ((AUTO, COMPLETE), (AUTO, COMPLETE), True),
        ((AUTO, COMPLETE), (HOLD, COMPLETE), True),
        ((AUTO, UNKNOWN), (AUTO, UNKNOWN), True),
        ((AUTO, ACTIVE), (AUTO, ACTIVE), True),  # Of a mission that ends with a hold
        ((HOLD, ACTIVE), (AUTO, NONE), True),  # It has nothing to fly
        ((HOLD, COMPLETE), (AUTO, ACTIVE), False),
        ((HOLD, UNKNOWN), (AUTO, UNKNOWN), False),
        ((AUTO, COMPLETE), (AUTO, ACTIVE), False),
        ((AUTO, ACTIVE), (AUTO, ACTIVE._replace(mission_id=8)), False),
    ],
)
def test_it_ends_with_a_mission_that_another_system_has_started(
    began: tuple[ObservedMode, MissionNow], now: tuple[ObservedMode, MissionNow], *, is_held: bool
) -> None:
    for is_ordered in (True, False):
        hover = Hover()
        hover.begin(airborne(mission=began[1]), began[0])
        hover.update(airborne(mission=now[1]), now[0], is_identified=True, is_ordered=is_ordered)
        assert hover.is_held is (is_ordered or is_held)


def test_a_mission_mode_that_was_left_is_not_entered_again_by_the_broker() -> None:
    hover = Hover()
    hover.begin(airborne(mission=UNKNOWN), AUTO)
    hover.update(airborne(mission=UNKNOWN), HOLD, is_identified=True)
    hover.update(airborne(mission=UNKNOWN), AUTO, is_identified=True)
    assert not hover.is_held


@pytest.mark.parametrize("in_this_mode", [False, True])
def test_a_mode_to_which_no_order_to_wait_leads_is_the_broker_s_until_it_is_left(
    *, in_this_mode: bool
) -> None:
    hover = Hover()
    hover.begin(airborne(), BRAKE, in_this_mode=in_this_mode)
    hover.update(airborne(), BRAKE, is_identified=True)
    assert hover.is_held is in_this_mode
    hover.update(airborne(), HOLD, is_identified=True)
    hover.update(airborne(), BRAKE, is_identified=True)
    assert not hover.is_held


@pytest.mark.parametrize(
    ("noted", "mode", "mission", "is_found"),
    [
        (BRAKE, BRAKE, None, True),
        (HOLD, BRAKE, None, False),
        (HOLD, HOLD, ACTIVE, True),
        (AUTO, HOLD, None, True),
        (AUTO, AUTO, ACTIVE, True),  # Of a mission that ends with a hold
        (HOLD, AUTO, ACTIVE, False),
        (HOLD, AUTO, UNKNOWN, False),
        (HOLD, AUTO, NONE, True),
        (HOLD, PILOT, None, False),
    ],
)
def test_a_restarted_broker_finds_it_unless_another_mission_was_started(
    noted: ObservedMode, mode: ObservedMode, mission: MissionNow | None, *, is_found: bool
) -> None:
    hover = Hover()
    hover.recall(NOTED, noted.mode)
    hover.update(airborne(mission=mission), mode, is_identified=True)
    assert hover.is_held is is_found
