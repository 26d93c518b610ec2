"""Sets the item at which a mission begins, and sees the vehicle say so.

A vehicle may remember the index of its former mission and fly off towards an old waypoint.
DO_SET_MISSION_CURRENT(224) first; where it is refused, MISSION_SET_CURRENT(41), which is never
acknowledged. Either way only MISSION_CURRENT with the right index is a success.

ArduPilot counts only what it navigates to: told to begin at a change of speed, it says that the
take-off behind is current. PX4 judges a mission after it has accepted it, and then says that it
has none. It tells MISSION_CURRENT once a second, and not on request.
"""

from collections.abc import Collection
from typing import Final

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    CommandLong,
    CommandOutcome,
    CommandTransaction,
    Refused,
)
from mavlink_broker.microservices.message_rates import request_message
from mavlink_broker.microservices.round_trip import RoundTrip

ATTEMPTS: Final = 10
ASK_EVERY_S: Final = 1.0
"""At least: MISSION_CURRENT may come no more often, and each older message writes to storage."""
JUDGED_WITHIN_S: Final = 4.0
"""How long a vehicle may take to find that it can fly what it has accepted."""
_RESET: Final = 1.0
"""Second parameter of 224: also forget jump counters and a former completion."""


class MissionSelect:
    """One selection of the current item; `shown_as` are the numbers that prove it."""

    def __init__(
        self,
        seq: int,
        route: Route,
        round_trip: RoundTrip,
        *,
        shown_as: Collection[int] = (),
    ) -> None:
        self._seq = seq
        self._shown_as = frozenset({seq, *shown_as})
        self._doubted_since: float | None = None
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
            if message.get_type() == "MISSION_CURRENT" and message.seq in self._shown_as:
                self._judge(message, now)
            elif not settled:
                return self._ask(now)
        return []

    def _judge(self, message: Message, now: float) -> None:
        """Believe a vehicle that knows its mission; one that denies it may still be judging it."""
        if message.mission_state != mavlink.MISSION_STATE_NO_MISSION:
            self.outcome = Accepted()
        elif self._doubted_since is None:
            self._doubted_since = now
        elif now - self._doubted_since >= JUDGED_WITHIN_S:
            self.outcome = Refused("the vehicle holds the mission and finds that it cannot fly it")

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
        self._deadline = now + max(ASK_EVERY_S, self._round_trip.timeout_s)
        messages = [request_message(self._route, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)]
        if isinstance(self._command.outcome, Refused):
            target = self._route.target_system, self._route.target_component
            messages.insert(0, mavlink.MAVLink_mission_set_current_message(*target, self._seq))
        return messages
