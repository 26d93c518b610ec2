"""Which senders are autopilots that may fly a mission."""

import pytest

from mavlink_broker.mavlink.components import (
    AUTOPILOT,
    NOT_VEHICLES,
    is_vehicle,
    replaces_autopilot,
)
from mavlink_broker.mavlink.dialect import Message, mavlink


def heartbeat(component: int, *, kind: int = mavlink.MAV_TYPE_QUADROTOR) -> Message:
    message = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_GENERIC, 0, 0, 4, 3)
    message.pack(mavlink.MAVLink(None, 7, component))
    return message


@pytest.mark.parametrize("kind", sorted(NOT_VEHICLES))
def test_what_does_not_fly_is_no_vehicle(kind: int) -> None:
    message = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 4, 3)
    assert not is_vehicle(message)


@pytest.mark.parametrize(
    ("component", "is_autopilot"),
    [
        (AUTOPILOT, True),
        (mavlink.MAV_COMP_ID_USER1, True),
        (mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, False),
        (mavlink.MAV_COMP_ID_CAMERA, False),
    ],
)
def test_a_part_that_reports_a_generic_autopilot_is_no_vehicle(
    component: int, *, is_autopilot: bool
) -> None:
    assert is_vehicle(heartbeat(component)) is is_autopilot


def test_the_standard_component_replaces_another_autopilot_and_no_other_does() -> None:
    assert replaces_autopilot(AUTOPILOT, 25)
    assert replaces_autopilot(25, None)
    assert not replaces_autopilot(25, AUTOPILOT)
    assert not replaces_autopilot(AUTOPILOT, AUTOPILOT)
