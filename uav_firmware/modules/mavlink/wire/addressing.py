"""Who said something and to whom an answer goes."""

from typing import Final, NamedTuple

from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.dialect import Message

AUTOPILOT_COMPONENT: Final = 1
"""MAV_COMP_ID_AUTOPILOT1: the vehicle, and its gimbal."""
CAMERA_COMPONENT: Final = 100
"""MAV_COMP_ID_CAMERA."""
OWN_COMPONENTS: Final = frozenset({AUTOPILOT_COMPONENT, CAMERA_COMPONENT})
"""What speaks for this vehicle; what else has its system id is a computer on board."""


class Sender(NamedTuple):
    """The origin of a received message: its MAVLink ids and the way back."""

    system: int
    component: int
    address: Address

    @property
    def identity(self) -> tuple[int, int]:
        """System and component, which stay the same when the address changes."""
        return (self.system, self.component)


class Outgoing(NamedTuple):
    """A message to send, to one address or (None) to every peer."""

    message: Message
    to: Address | None = None
    component: int = AUTOPILOT_COMPONENT  # That says it


def is_for_us(message: Message, system_id: int, own_component: int = AUTOPILOT_COMPONENT) -> bool:
    """Whether a targeted message names this system, and this component or all of them."""
    component: int = message.target_component
    return message.target_system == system_id and component in {0, own_component}
