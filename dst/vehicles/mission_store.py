"""The missions on a vehicle, and their transfer: MAVLink's mission protocol, the vehicle's end."""

from collections.abc import Callable
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.scheduler import Scheduler
from dst.vehicles.flight import HOME_E7, is_same_place

REPEAT_REQUEST_S: Final = 0.5
TRANSFER_TIMEOUT_S: Final = 5.0
_BROKER: Final = 254, 191
"""System and component that it answers."""


class MissionStore:
    """Mission, geofence and rally points; each is replaced as a whole, and survives a restart."""

    def __init__(self, scheduler: Scheduler, send: Callable[[Any], None]) -> None:
        """Begin empty; `send` takes each message."""
        self._scheduler = scheduler
        self._send = send
        self._plans: dict[int, list[Any]] = {}  # By MAV_MISSION_TYPE
        self._transfer: dict[int, Any] = {}
        self._count = 0  # Of the transfer; 0 without one
        self._type = 0
        self._requested_s = 0.0
        self._progress_s = 0.0

    @property
    def items(self) -> list[Any]:
        """The items of the mission."""
        return self._plans.get(mavlink.MAV_MISSION_TYPE_MISSION, [])

    @property
    def places_e7(self) -> frozenset[tuple[int, int]]:
        """Latitude and longitude [1e-7 deg] of the mission's waypoints, but those at home."""
        waypoint = mavlink.MAV_CMD_NAV_WAYPOINT
        places = {(one.x, one.y) for one in self.items if one.command == waypoint}
        return frozenset(place for place in places if not is_same_place(place, HOME_E7))

    @property
    def has_fence(self) -> bool:
        """Whether there is a geofence."""
        return bool(self._plans.get(mavlink.MAV_MISSION_TYPE_FENCE))

    def forget(self) -> None:
        """Be empty, as of another aircraft."""
        self._plans.clear()
        self.forget_transfer()

    def forget_transfer(self) -> None:
        """End a transfer that runs."""
        self._count = 0

    def tick(self) -> None:
        """Repeat a request that is not answered."""
        if self._count and self._scheduler.now_s - self._requested_s > REPEAT_REQUEST_S:
            self._request()

    def receive(self, message: Any) -> bool:
        """Handle a message of the protocol; gives whether the mission is another one now."""
        match message.get_type():
            case "MISSION_COUNT":
                self._begin(message)
            case "MISSION_ITEM_INT":
                return self._take(message)
            case "MISSION_REQUEST_LIST":
                kind = message.mission_type
                count = len(self._plans.get(kind, []))
                self._send(mavlink.MAVLink_mission_count_message(*_BROKER, count, kind))
            case "MISSION_REQUEST_INT" | "MISSION_REQUEST":
                self._send_item(message)
            case "MISSION_CLEAR_ALL":
                self._plans.pop(message.mission_type, None)
                self._acknowledge(mavlink.MAV_MISSION_ACCEPTED, message.mission_type)
        return False

    def _acknowledge(self, result: int, kind: int) -> None:
        self._send(mavlink.MAVLink_mission_ack_message(*_BROKER, result, kind))

    def _begin(self, message: Any) -> None:
        self._transfer, self._type = {}, message.mission_type
        self._count = message.count
        if not message.count:
            self._plans.pop(message.mission_type, None)
            self._acknowledge(mavlink.MAV_MISSION_ACCEPTED, message.mission_type)
            return
        self._progress_s = self._scheduler.now_s
        self._request()

    def _request(self) -> None:
        self._requested_s = self._scheduler.now_s
        if self._requested_s - self._progress_s > TRANSFER_TIMEOUT_S:
            self._count = 0
            return
        seq = len(self._transfer)
        self._send(mavlink.MAVLink_mission_request_int_message(*_BROKER, seq, self._type))

    def _take(self, message: Any) -> bool:
        kind = message.mission_type
        if not self._count:
            if message.seq == len(self._plans.get(kind, [])) - 1:
                self._acknowledge(mavlink.MAV_MISSION_ACCEPTED, kind)
            return False
        if kind != self._type:
            return False
        if message.seq == len(self._transfer):
            self._transfer[message.seq] = message
            self._progress_s = self._scheduler.now_s
        if len(self._transfer) < self._count:
            self._request()
            return False
        self._plans[kind] = [self._transfer[seq] for seq in range(self._count)]
        self._count = 0
        self._acknowledge(mavlink.MAV_MISSION_ACCEPTED, kind)
        return bool(kind == mavlink.MAV_MISSION_TYPE_MISSION)

    def _send_item(self, message: Any) -> None:
        items = self._plans.get(message.mission_type, [])
        if message.seq < len(items):
            item = items[message.seq]
            item.target_system, item.target_component = _BROKER
            self._send(item)
        else:
            self._acknowledge(mavlink.MAV_MISSION_INVALID_SEQUENCE, message.mission_type)
