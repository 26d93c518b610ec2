"""Sets the item at which a mission begins, and sees the vehicle say so.

A vehicle may remember the index of its former mission and fly off towards an old waypoint.
DO_SET_MISSION_CURRENT(224) first; where it is refused, MISSION_SET_CURRENT(41), which is never
acknowledged. Either way only MISSION_CURRENT with the right index is a success.
"""

from typing import Final

from mavlink_broker.dialect import Message, mavlink
from mavlink_broker.protocol.command import (
    Accepted,
    CommandLong,
    CommandOutcome,
    CommandTransaction,
    Refused,
)
from mavlink_broker.protocol.round_trip import RoundTrip
from mavlink_broker.protocol.route import Route
from mavlink_broker.protocol.streams import request_message

ATTEMPTS: Final = 10
_RESET: Final = 1.0
"""Second parameter of 224: also forget jump counters and a former completion."""


class MissionSelect:
    """One selection of the current item."""

    def __init__(self, seq: int, route: Route, round_trip: RoundTrip) -> None:
        self._seq = seq
        self._route = route
        self._round_trip = round_trip
        self._attempts = 0
        self._deadline = 0.0
        self._command = CommandTransaction(
            CommandLong(
                command=mavlink.MAV_CMD_DO_SET_MISSION_CURRENT,
                parameters=(float(seq), _RESET, 0.0, 0.0, 0.0, 0.0, 0.0),
            ),
            route,
            round_trip,
        )
        self.outcome: CommandOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Send the command."""
        return self._command.start(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take the acknowledgement, then the vehicle's own word on its current item."""
        if self.outcome is not None:
            return []
        settled = self._command.outcome is not None
        self._command.receive(message, now)
        if self._command.outcome is not None:
            if message.get_type() == "MISSION_CURRENT" and message.seq == self._seq:
                self.outcome = Accepted()
            elif not settled:
                return self._ask(now)
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        if self.outcome is not None:
            return []
        if self._command.outcome is None:
            return self._command.tick(now)
        if now < self._deadline:
            return []
        if self._attempts >= ATTEMPTS:
            self.outcome = Refused(f"the vehicle does not make item {self._seq} its current one")
            return []
        return self._ask(now)

    def _ask(self, now: float) -> list[Message]:
        self._attempts += 1
        self._deadline = now + self._round_trip.timeout_s
        messages = [request_message(self._route, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)]
        if isinstance(self._command.outcome, Refused):
            target = self._route.target_system, self._route.target_component
            messages.insert(0, mavlink.MAVLink_mission_set_current_message(*target, self._seq))
        return messages
