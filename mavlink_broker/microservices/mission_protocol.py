"""The mission protocol beside its transfers: kinds of plan, float items, the current item.

A vehicle holds three kinds of plan, by MAV_MISSION_TYPE, each with its own transfers.

`MissionSetCurrent` sets the current item and waits until the vehicle reports it. A vehicle may
remember the index of its former mission and fly towards an old waypoint. The broker sends
DO_SET_MISSION_CURRENT(224); if it is refused, MISSION_SET_CURRENT(41), which is never acknowledged.
Only MISSION_CURRENT with the right index is a success.

ArduPilot reports navigation items only: set to a change of speed, it reports the take-off after it.
PX4 checks a mission after it has accepted it, and reports "no mission" if it is not feasible. It
sends MISSION_CURRENT once a second, and not on request.
"""

from collections.abc import Collection
from typing import Final

from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    CommandLong,
    CommandOutcome,
    CommandTransaction,
    Refused,
    RoundTrip,
)
from mavlink_broker.microservices.message_rates import request_message

MISSION: Final[int] = mavlink.MAV_MISSION_TYPE_MISSION
FENCE: Final[int] = mavlink.MAV_MISSION_TYPE_FENCE
RALLY: Final[int] = mavlink.MAV_MISSION_TYPE_RALLY

PLAN_NAMES: Final = {MISSION: "mission", FENCE: "geofence", RALLY: "rally points"}
UNTYPED_COMMANDS: Final = {
    FENCE: frozenset(
        {
            mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT,
            mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
            mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
            mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
            mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
        }
    ),
    RALLY: frozenset({mavlink.MAV_CMD_NAV_RALLY_POINT}),
}
"""Items that belong to a kind of plan though they say that they are a mission's."""
ID_NAMES: Final = {MISSION: "mission_id", FENCE: "fence_id", RALLY: "rally_points_id"}
"""Fields of MISSION_CURRENT with the id of each."""
MAX_ITEMS: Final = 5_000
"""Largest plan that is read from a vehicle, and largest fence in the journal."""

_PLAIN_FRAMES: Final = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
}
POSITION_STEP_DEG: Final = 1.6e-5
"""Resolution of single precision beyond 128 degrees; some 1.8 m."""
POSITION_TOLERANCE_DEG: Final = 1.5e-7
"""One unit of the encoded integer."""
ALTITUDE_TOLERANCE_M: Final = 0.011
"""ArduPilot stores centimetres."""
_FLOATS: Final[int] = mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
_INTEGERS: Final[int] = mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT


def supports_only_float_items(capabilities: int) -> bool:
    """Whether AUTOPILOT_VERSION reports float items only.

    A vehicle that reports neither kind supports integers: MISSION_REQUEST(40) proves nothing.
    """
    return capabilities & (_FLOATS | _INTEGERS) == _FLOATS


def to_float_item(item: Message) -> Message:
    """Convert a MISSION_ITEM_INT(73) to a MISSION_ITEM(39), which is less precise."""
    scale = 1.0 if item.frame == mavlink.MAV_FRAME_MISSION else 1e7
    return mavlink.MAVLink_mission_item_message(
        item.target_system,
        item.target_component,
        item.seq,
        _PLAIN_FRAMES.get(item.frame, item.frame),
        item.command,
        item.current,
        item.autocontinue,
        *(item.param1, item.param2, item.param3, item.param4),
        *(item.x / scale, item.y / scale, item.z),
        item.mission_type,
    )


ATTEMPTS: Final = 10
REQUEST_INTERVAL_S: Final = 1.0
"""MISSION_CURRENT may not be sent more often, and each MISSION_SET_CURRENT writes to storage."""
FEASIBILITY_CHECK_S: Final = 4.0
"""How long a vehicle may take to check a mission that it has accepted."""


class MissionSetCurrent:
    """Sets one current item; `shown_as` are further item numbers that confirm it.

    `resets`: also reset jump counters and a former completion. ArduPilot since 4.5 takes that for
    an order to begin, in whatever mode it is, and ends a completion without it.
    """

    def __init__(
        self,
        seq: int,
        route: Route,
        round_trip: RoundTrip,
        *,
        shown_as: Collection[int] = (),
        resets: bool = True,
    ) -> None:
        self._seq = seq
        self._shown_as = frozenset({seq, *shown_as})
        self._no_mission_since: float | None = None
        self._route = route
        self._round_trip = round_trip
        self._attempts = 0
        self._deadline = 0.0
        self._command = CommandTransaction(
            CommandLong(
                command=mavlink.MAV_CMD_DO_SET_MISSION_CURRENT,
                parameters=(float(seq), float(resets), 0.0, 0.0, 0.0, 0.0, 0.0),
            ),
            route,
            round_trip,
        )
        self.outcome: CommandOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Send the command."""
        return self._command.start(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle the acknowledgement, then MISSION_CURRENT."""
        if self.outcome is not None:
            return []
        was_settled = self._command.outcome is not None
        self._command.receive(message, now)
        if self._command.outcome is not None:
            if message.get_type() == "MISSION_CURRENT" and message.seq in self._shown_as:
                self._check_mission_state(message, now)
            elif not was_settled:
                return self._request(now)
        return []

    def _check_mission_state(self, message: Message, now: float) -> None:
        """Succeed if the vehicle has a mission; wait while it may still be checking it."""
        if message.mission_state != mavlink.MISSION_STATE_NO_MISSION:
            self.outcome = Accepted()
        elif self._no_mission_since is None:
            self._no_mission_since = now
        elif now - self._no_mission_since >= FEASIBILITY_CHECK_S:
            self.outcome = Refused(
                "the vehicle holds the mission and reports that it is not feasible"
            )

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        if self.outcome is not None:
            return []
        if self._command.outcome is None:
            return self._command.tick(now)
        if now < self._deadline:
            return []
        if self._attempts >= ATTEMPTS:
            self.outcome = Refused(
                f"the vehicle does not report item {self._seq} as the current one"
            )
            return []
        return self._request(now)

    def _request(self, now: float) -> list[Message]:
        self._attempts += 1
        self._deadline = now + max(REQUEST_INTERVAL_S, self._round_trip.timeout_s)
        messages = [request_message(self._route, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)]
        if isinstance(self._command.outcome, Refused):
            messages.insert(
                0, mavlink.MAVLink_mission_set_current_message(*self._route.target, self._seq)
            )
        return messages
