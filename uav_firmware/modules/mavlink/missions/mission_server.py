"""The mission protocol's vehicle end: three plans, their uploads, downloads and removal.

Sans-IO. A download is stateless: any item may be asked for in any order, any number of times,
by several peers at once, also while an upload is under way.
"""

from collections.abc import Callable, Mapping
from typing import Final

from uav_firmware.modules.mavlink.missions.mission_items import to_message
from uav_firmware.modules.mavlink.missions.mission_store import ACCEPTED, PlanStore, Verdict
from uav_firmware.modules.mavlink.missions.mission_upload import (
    ECHO_US,
    Reply,
    UploadReceiver,
    acknowledge,
)
from uav_firmware.modules.mavlink.telemetry.status_text import StatusTexts
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import MissionCount

_MISSION: Final[int] = mavlink.MAV_MISSION_TYPE_MISSION
_ALL_TYPES: Final[int] = mavlink.MAV_MISSION_TYPE_ALL
_INVALID: Final[int] = mavlink.MAV_MISSION_INVALID
_DENIED: Final[int] = mavlink.MAV_MISSION_DENIED
_UNSUPPORTED: Final[int] = mavlink.MAV_MISSION_UNSUPPORTED
_NAMES: Final = ("Mission", "Geofence", "Rally points")
_COMPONENTS: Final = frozenset({0, 1, mavlink.MAV_COMP_ID_MISSIONPLANNER})


class MissionServer:
    """Serves every MISSION_ message but MISSION_SET_CURRENT."""

    def __init__(
        self,
        *,
        system_id: int,
        stores: Mapping[int, PlanStore],
        current_seq: Callable[[], int],
        texts: StatusTexts,
    ) -> None:
        """Begin with the plans that the stores hold.

        Args:
            system_id: System that messages must name.
            stores: The plans, by MAV_MISSION_TYPE.
            current_seq: Gives the item that the navigator flies.
            texts: Where sentences for the operator go.
        """
        self._system_id = system_id
        self._stores = stores
        self._current_seq = current_seq
        self._texts = texts
        self._uploads = {kind: UploadReceiver(kind, store) for kind, store in stores.items()}
        self._cleared: tuple[bytes, int] = (b"", 0)  # Frame and time of the last CLEAR_ALL
        self._handlers: Mapping[str, Callable[[Message, Sender, int], list[Outgoing]]] = {
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_ITEM": self._item,
            "MISSION_REQUEST_LIST": self._request_list,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_REQUEST": self._request,
            "MISSION_CLEAR_ALL": self._clear,
            "MISSION_ACK": self._ack,
            "MISSION_REQUEST_PARTIAL_LIST": self._partial,
            "MISSION_WRITE_PARTIAL_LIST": self._partial,
        }

    @property
    def message_types(self) -> frozenset[str]:
        """Names of the messages that `handle` takes."""
        return frozenset(self._handlers)

    @property
    def mission_length(self) -> int:
        """Number of items of the stored mission."""
        return len(self._stores[_MISSION].items)

    def load(self) -> list[str]:
        """Publish what a former run has stored; gives a sentence for each plan lost."""
        return [fault for store in self._stores.values() if (fault := store.load())]

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take a message of the mission protocol."""
        addressed = message.target_system == self._system_id
        if not addressed or message.target_component not in _COMPONENTS:
            return []
        return self._handlers[message.get_type()](message, sender, now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Ask again for items that stay away, judge, end uploads that have fallen silent."""
        outgoing: list[Outgoing] = []
        for mission_type, upload in self._uploads.items():
            self._stores[mission_type].tick(now_us)
            if upload.is_receiving:
                outgoing += self._told(mission_type, upload.tick(now_us))
        return outgoing

    def _count(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        upload = self._uploads.get(message.mission_type)
        if upload is None:
            return [acknowledge(sender, _INVALID, message.mission_type)]
        return self._told(message.mission_type, upload.begin(message, sender, now_us))

    def _item(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        upload = self._uploads.get(message.mission_type)
        if upload is None:
            return [acknowledge(sender, _INVALID, message.mission_type)]
        return self._told(message.mission_type, upload.item(message, sender, now_us))

    def _request_list(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        store = self._stores.get(message.mission_type)
        if store is None:
            return [acknowledge(sender, _INVALID, message.mission_type)]
        answer = MissionCount(
            target_system=sender.system,
            target_component=sender.component,
            count=len(store.items),
            mission_type=message.mission_type,
            opaque_id=store.plan_id,
        )
        return [Outgoing(answer, sender.address)]

    def _request(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        store = self._stores.get(message.mission_type)
        if store is None:
            return [acknowledge(sender, _INVALID, message.mission_type)]
        if message.seq >= len(store.items):
            refused = mavlink.MAV_MISSION_INVALID_SEQUENCE
            return [acknowledge(sender, refused, message.mission_type)]
        answer = to_message(
            store.items[message.seq],
            message.seq,
            current=message.mission_type == _MISSION and message.seq == self._current_seq(),
            mission_type=message.mission_type,
        )
        answer.target_system, answer.target_component = sender.identity
        return [Outgoing(answer, sender.address)]

    def _clear(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Remove one plan or all three; while somebody else uploads one of them, none."""
        mission_type = message.mission_type
        types = tuple(self._stores) if mission_type == _ALL_TYPES else (mission_type,)
        if mission_type not in {*self._stores, _ALL_TYPES}:
            return [acknowledge(sender, _INVALID, mission_type)]
        if any(self._uploads[each].is_foreign(sender) for each in types):
            return [acknowledge(sender, _DENIED, mission_type)]
        if any(self._stores[each].is_writing for each in types):
            return []  # Too late; it is sent again
        frame = bytes(message.get_msgbuf() or b"")
        if self._is_late_copy(frame, now_us) and any(self._stores[each].items for each in types):
            return []  # What it removed has been replaced since
        self._cleared = (frame, now_us)
        verdicts: list[Verdict] = []

        def conclude(verdict: Verdict) -> Reply:
            """One answer for all kinds, when the last is removed or not."""
            verdicts.append(verdict)
            if len(verdicts) < len(types):
                return Reply()
            failed = [each for each in verdicts if each.result != ACCEPTED]
            worst = (failed or verdicts)[0]
            return Reply((acknowledge(sender, worst.result, mission_type),), worst.reason)

        replies = [self._uploads[each].clear(sender, now_us, conclude) for each in types]
        return [message for reply in replies for message in self._told(types[0], reply)]

    def _is_late_copy(self, frame: bytes, now_us: int) -> bool:
        """Whether a CLEAR_ALL is the same frame, number and all, as one carried out just now."""
        cleared, time_us = self._cleared
        return frame == cleared != b"" and now_us - time_us < ECHO_US

    def _ack(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        """An ACK ends a download (nothing to do) or cancels the sender's own upload."""
        upload = self._uploads.get(message.mission_type)
        if upload is not None and message.type != ACCEPTED:
            upload.cancel(sender)
        return []

    def _partial(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        return [acknowledge(sender, _UNSUPPORTED, message.mission_type)]

    def _told(self, mission_type: int, reply: Reply) -> list[Outgoing]:
        """Messages of a reply, with a STATUSTEXT where there is a reason for one."""
        if not reply.refusal:
            return list(reply.messages)
        text = f"{_NAMES[mission_type]} upload refused: {reply.refusal}"
        return [*reply.messages, *self._texts.say(mavlink.MAV_SEVERITY_WARNING, text)]
