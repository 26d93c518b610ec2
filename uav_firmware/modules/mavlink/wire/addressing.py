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


STREAM_TIMEOUT_US: Final = 1_000_000
"""Time without an accepted message of the current sender after which another one is accepted."""


class StreamSender:
    """The sender whose stream the vehicle follows: one at a time, until it falls silent.

    Another address is another sender: two stations have the same ids where neither has been given
    its own.
    """

    def __init__(self) -> None:
        self._sender: Sender | None = None
        self._received_us = 0

    def admits(self, sender: Sender, now_us: int) -> bool:
        """Whether a message of a sender may be followed now."""
        return not self.is_other(sender) or now_us - self._received_us > STREAM_TIMEOUT_US

    def is_other(self, sender: Sender) -> bool:
        """Whether another sender has been followed so far."""
        return self._sender not in {None, sender}

    def accept(self, sender: Sender, now_us: int) -> None:
        """Follow the sender of an accepted message."""
        self._sender, self._received_us = sender, now_us


class Outgoing(NamedTuple):
    """A message to send, to one address or (None) to every peer."""

    message: Message
    to: Address | None = None
    component: int = AUTOPILOT_COMPONENT  # Source component


def is_for_us(message: Message, system_id: int, own_component: int = AUTOPILOT_COMPONENT) -> bool:
    """Whether a targeted message names this system, and this component or all of them."""
    component: int = message.target_component
    return message.target_system == system_id and component in {0, own_component}
