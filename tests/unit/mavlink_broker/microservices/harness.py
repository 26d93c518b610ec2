"""What protocol tests share: a route, and messages as they come from the wire."""

from collections.abc import Sequence
from typing import Any

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, Route, mavlink

ROUTE = Route(own_system=254, own_component=191, target_system=1, target_component=1)


def received(message: Message) -> Message:
    """Give a message as the vehicle's autopilot sent it."""
    (decoded,) = Decoder().decode(Encoder(1, 1).encode(message))
    return decoded


def acknowledgement(command: int, result: int, target_system: int = 254) -> Message:
    """COMMAND_ACK to us."""
    return received(mavlink.MAVLink_command_ack_message(command, result, 0, 0, target_system, 191))


def kinds(messages: Sequence[Message]) -> list[str]:
    """Names of messages."""
    return [message.get_type() for message in messages]


def tick_until(activity: Any, now: float, until: float, step: float = 0.05) -> list[Message]:
    """Let time pass; gives everything that was sent meanwhile."""
    sent: list[Message] = []
    while now < until:
        now += step
        sent += activity.tick(now)
    return sent
