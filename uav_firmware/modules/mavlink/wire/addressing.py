"""Senders, recipients and the vehicle's own components."""

from typing import Final, NamedTuple

from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.dialect import Message

AUTOPILOT_COMPONENT: Final = 1
"""MAV_COMP_ID_AUTOPILOT1: the vehicle, and its gimbal."""
CAMERA_COMPONENT: Final = 100
"""MAV_COMP_ID_CAMERA."""
SECOND_CAMERA_COMPONENT: Final = 101
"""MAV_COMP_ID_CAMERA2: takes the second picture with each picture, while a parameter says so."""
OWN_COMPONENTS: Final = frozenset({AUTOPILOT_COMPONENT, CAMERA_COMPONENT, SECOND_CAMERA_COMPONENT})
"""Components of this module; another component of the system is a companion computer."""


class Sender(NamedTuple):
    """Origin of a received message: MAVLink ids and network address."""

    system: int
    component: int
    address: Address

    @property
    def identity(self) -> tuple[int, int]:
        """System and component id, which do not change with the address."""
        return (self.system, self.component)


class Outgoing(NamedTuple):
    """A message to send, to one address or (None) to every peer."""

    message: Message
    to: Address | None = None
    component: int = AUTOPILOT_COMPONENT  # Source component


def is_for_us(message: Message, system_id: int, own_component: int = AUTOPILOT_COMPONENT) -> bool:
    """Whether a targeted message names this system, and this component or all of them."""
    component: int = message.target_component
    return message.target_system == system_id and component in {0, own_component}
