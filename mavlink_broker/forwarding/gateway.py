"""Between vehicles and ground stations: what goes over, in which copy, to whom.

A ground station's own heartbeat stays here: a vehicle that has heard one may fly home when
somebody closes his laptop. It goes over only where ground stations may command at all times.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.forwarding.numbering import Numbering
from mavlink_broker.forwarding.policy import answers_as, is_message_id, judge, target_of
from mavlink_broker.forwarding.refusals import Refusals
from mavlink_broker.forwarding.verdict import Answer, Later, Pass, Refuse, Tenure
from mavlink_broker.mavlink.codec import encoded_as
from mavlink_broker.mavlink.dialect import Message, Source, mavlink, source_of
from mavlink_broker.mavlink.frames import unsigned

WATCHED_S: Final = 10.0
"""So long after his last word somebody is taken to be watching."""
ASKED_KEPT: Final = 500
"""Kinds of messages; there are no more that a vehicle could send."""


@dataclass(slots=True)
class Crossing:
    """What one message of a ground station leads to."""

    to_vehicles: list[tuple[Source, bytes]] = field(default_factory=list)  # Component 0: autopilot
    to_ground: list[bytes] = field(default_factory=list)  # Unsigned, for every ground station


class Gateway:
    """Passes frames between the vehicles of one broker and all ground stations."""

    def __init__(
        self,
        own_system: int,
        tenure: Callable[[int], Tenure],
        lived_on_us: Mapping[int, float],
        *,
        may_command: bool,
    ) -> None:
        """Know the broker, whose each vehicle is, and the intervals of the broker's streams."""
        self._own_system = own_system
        self._tenure = tenure
        self._lived_on_us = lived_on_us
        self._may_command = may_command
        self._numbering = Numbering()
        self._heard_at: float | None = None
        self._asked: dict[int, set[int]] = {}
        self.refusals = Refusals()

    def is_watched(self, now: float) -> bool:
        """Whether a ground station has spoken lately."""
        return self._heard_at is not None and now - self._heard_at <= WATCHED_S

    def asked_of(self, system: int, now: float) -> Collection[int] | None:
        """Messages that somebody watching has asked a vehicle for; None: nobody watches."""
        if not self.is_watched(now):
            self._asked.clear()
            return None
        return self._asked.get(system, ())

    def from_vehicle(self, message: Message) -> bytes | None:
        """Give the unsigned copy of a vehicle's frame; None if it is the broker's alone."""
        if target_of(message) == self._own_system:
            self._numbering.withheld(source_of(message))
            return None
        return self._numbering.passed(unsigned(bytes(message.get_msgbuf())))

    def from_ground(self, message: Message, vehicles: Collection[int], now: float) -> Crossing:
        """Judge a ground station's message for every vehicle that it is meant for."""
        crossing = Crossing()
        source = source_of(message)
        if source.system in vehicles or source.system in {0, self._own_system}:
            return crossing  # Nobody speaks for a vehicle but itself
        self._heard_at = now
        self.refusals.tell(now)
        if message.get_type() == "HEARTBEAT" and not self._may_command:
            return crossing
        target = target_of(message)
        for system in vehicles:
            if target in {0, system}:
                self._cross(message, system, crossing, now)
        return crossing

    def _cross(self, message: Message, system: int, crossing: Crossing, now: float) -> None:
        tenure = Tenure.FREE if self._may_command else self._tenure(system)
        answerer = Source(system, answers_as(message).component)
        to_whom = Source(system, getattr(message, "target_component", 0))
        match judge(message, tenure, self._lived_on_us):
            case Pass():
                self._note(message, system)
                crossing.to_vehicles.append((to_whom, bytes(message.get_msgbuf())))
            case Answer(answer):
                crossing.to_ground.append(self._said_as(answerer, answer))
            case Later():
                return
            case Refuse(answer, instead):
                if answer is not None:
                    crossing.to_ground.append(self._said_as(answerer, answer))
                if instead is not None:
                    frame = encoded_as(instead, source_of(message), message.get_seq())
                    crossing.to_vehicles.append((to_whom, frame))
                self._explain(message, answerer, crossing, now)

    def _note(self, message: Message, system: int) -> None:
        """Remember which message was asked for: how often it comes is his affair now."""
        command = getattr(message, "command", None)
        if command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and is_message_id(message.param1):
            asked = self._asked.setdefault(system, set())
            if len(asked) < ASKED_KEPT:
                asked.add(int(message.param1))

    def _explain(self, message: Message, answerer: Source, crossing: Crossing, now: float) -> None:
        sentence = self.refusals.add(message, answerer.system, now)
        if sentence is not None:
            autopilot = answerer._replace(component=mavlink.MAV_COMP_ID_AUTOPILOT1)
            text = mavlink.MAVLink_statustext_message(
                mavlink.MAV_SEVERITY_WARNING, sentence.encode("ascii", "replace")
            )
            crossing.to_ground.append(self._said_as(autopilot, text))

    def _said_as(self, source: Source, message: Message) -> bytes:
        return encoded_as(message, source, self._numbering.added(source))
