"""A vehicle's mission store that follows a script: PX4-like or ArduPilot-like.

What the scripts follow: PX4's `mavlink_mission.cpp` (atomic store, an id over the items, a
repeated last item acknowledged again, MISSION_ERROR when busy) and ArduPilot's
`MissionItemProtocol.cpp` (item 0 is home, float requests, items written one by one, no ids).
"""

import zlib
from collections.abc import Callable, Mapping
from typing import Any

from tests.support.vehicle_script import Script
from tests.support.vehicle_wire import Message, mavlink, with_plan_ids

_REPEAT_REQUEST_S = 0.25
_IDLE_TRANSFER_S = 5.0


class ScriptedMissions:
    """The mission protocol's vehicle end; `send` sends, `stored` is called for a new mission."""

    def __init__(
        self, script: Script, send: Callable[[Message], None], stored: Callable[[], None]
    ) -> None:
        self.script = script
        self.items: list[Message] = []
        self.uploads = 0
        self.refusals = 0
        self.busy_until = 0.0
        self.busy_answers = 0
        self.complain: Callable[[], None] = lambda: None
        self._send = send
        self._stored_call = stored
        self._now = 0.0
        self._transfer: dict[int, Message] = {}
        self._transfer_count = 0
        self._asked_at = 0.0
        self._progress_at = 0.0
        self._acknowledged: Message | None = None
        self._lost_acknowledgements = script.lost_acknowledgements

    def handle(self, message: Message, now: float) -> None:
        """Take a message of the mission protocol; others are ignored."""
        self._now = now
        handlers: Mapping[str, Callable[[Message], None]] = {
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_REQUEST_LIST": self._list,
            "MISSION_REQUEST_INT": self._request,
        }
        handler = handlers.get(message.get_type())
        if handler is not None:
            handler(message)

    def tick(self, now: float) -> None:
        """Ask again, or give up."""
        self._now = now
        if self._transfer_count == 0:
            return
        if now - self._progress_at > _IDLE_TRANSFER_S:
            self._transfer_count = 0
        elif now - self._asked_at >= _REPEAT_REQUEST_S:
            self._ask()

    def drop_transfer(self) -> None:
        """Forget a transfer, as a restart does."""
        self._transfer_count = 0

    def is_busy(self) -> bool:
        """Whether another system's transfer runs; its sender is answered so."""
        if self._now >= self.busy_until:
            return False
        self.busy_answers += 1
        self._acknowledge(mavlink.MAV_MISSION_ERROR)
        return True

    @property
    def plan_id(self) -> int:
        """The id of what is stored; 0 for none."""
        if not self.script.gives_ids or not self.items:
            return 0
        text = repr([_fields(item) for item in self.items])
        return zlib.crc32(text.encode()) or 1

    def _count(self, message: Message) -> None:
        if self.is_busy():
            return
        if message.count > self.script.most_items:
            self._acknowledge(mavlink.MAV_MISSION_NO_SPACE)
            return
        self._transfer = {}
        self._transfer_count = message.count
        if not self.script.is_atomic:
            del self.items[message.count :]
        self._acknowledged = None
        self._progress_at = self._now
        self._ask()

    def _item(self, message: Message) -> None:
        if self._transfer_count == 0:
            if self._acknowledged is not None and message.seq == len(self.items) - 1:
                self._final(self._acknowledged)
            return
        if message.seq != len(self._transfer):
            self._ask()
            return
        if message.seq == self.script.refused_item:
            self._refuse(mavlink.MAV_MISSION_INVALID_PARAM3)
            return
        if message.command in self.script.unknown_items:
            self._refuse(mavlink.MAV_MISSION_UNSUPPORTED)
            return
        kept = self._stored(message)
        if isinstance(kept, int):
            self._refuse(kept)
            return
        self._transfer[message.seq] = kept
        if not self.script.is_atomic:
            self.items[message.seq : message.seq + 1] = [kept]
        self._progress_at = self._now
        if len(self._transfer) < self._transfer_count:
            self._ask()
        else:
            self._complete()

    def _refuse(self, result: int) -> None:
        self.refusals += 1
        self._transfer_count = 0
        self.complain()
        self._acknowledge(result)

    def _stored(self, message: Message) -> Message | int:
        if self.script.keeps is not None and message.seq >= self.script.home_is_item_0:
            return self.script.keeps(message)
        if message.seq == self.script.corrupts_item:
            message.z += 5.0
        if self.script.forgets_parameters and message.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            message.param2 = message.param3 = message.param4 = 0.0
        return message

    def _complete(self) -> None:
        self.items = [self._transfer[seq] for seq in sorted(self._transfer)]
        self._transfer_count = 0
        self.uploads += 1
        self._stored_call()
        accepted = mavlink.MAVLink_mission_ack_message(0, 0, mavlink.MAV_MISSION_ACCEPTED)
        self._acknowledged = with_plan_ids(accepted, self.plan_id)
        self._final(self._acknowledged)

    def _final(self, acknowledgement: Message) -> None:
        if self._lost_acknowledgements > 0:
            self._lost_acknowledgements -= 1
            return
        self._send(acknowledgement)

    def _ask(self) -> None:
        self._asked_at = self._now
        kind = (
            mavlink.MAVLink_mission_request_message
            if self.script.float_requests
            else mavlink.MAVLink_mission_request_int_message
        )
        self._send(kind(0, 0, len(self._transfer)))

    def _list(self, message: Message) -> None:
        del message
        count = mavlink.MAVLink_mission_count_message(0, 0, len(self.items))
        self._send(with_plan_ids(count, self.plan_id))

    def _request(self, message: Message) -> None:
        if message.seq < len(self.items):
            item = self.items[message.seq]
            item.target_system = item.target_component = 0
            self._send(item)
        else:
            self._acknowledge(mavlink.MAV_MISSION_INVALID_SEQUENCE)

    def _acknowledge(self, result: int) -> None:
        self._send(mavlink.MAVLink_mission_ack_message(0, 0, result))


def _fields(item: Message) -> list[Any]:
    names = ("frame", "command", "param1", "param2", "param3", "param4", "x", "y", "z")
    return [getattr(item, name) for name in names]
