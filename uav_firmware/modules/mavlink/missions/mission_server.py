"""Server of the mission protocol: upload, download and removal of the three plans.

Sans-IO. Several peers may request any item in any order, any number of times, also during an
upload. Once another plan is in force, a download of the former one is refused.
"""

from collections.abc import Callable, Mapping
from typing import Final

from uav_firmware.modules.mavlink.missions.downloads import Downloads
from uav_firmware.modules.mavlink.missions.mission_items import to_message
from uav_firmware.modules.mavlink.missions.mission_store import ACCEPTED, Outcome, PlanStore
from uav_firmware.modules.mavlink.missions.mission_upload import (
    ANOTHER_UPLOADS,
    DUPLICATE_US,
    Reply,
    UploadReceiver,
    acknowledge,
)
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import MissionCount
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts

_MISSION: Final[int] = mavlink.MAV_MISSION_TYPE_MISSION
_ALL_TYPES: Final[int] = mavlink.MAV_MISSION_TYPE_ALL
_INVALID: Final[int] = mavlink.MAV_MISSION_INVALID
_CANCELLED: Final[int] = mavlink.MAV_MISSION_OPERATION_CANCELLED
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
        """Serve the plans of the stores.

        Args:
            system_id: System that messages must name.
            stores: The plans, by MAV_MISSION_TYPE.
            current_seq: Returns the item that the navigator flies.
            texts: Encodes texts for the operator.
        """
        self._system_id = system_id
        self._stores = stores
        self._current_seq = current_seq
        self._texts = texts
        self._uploads = {kind: UploadReceiver(kind, store) for kind, store in stores.items()}
        self._downloads = Downloads()
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
        """Names of the messages for `handle`."""
        return frozenset(self._handlers)

    @property
    def mission_length(self) -> int:
        """Number of items of the stored mission."""
        return len(self._stores[_MISSION].items)

    def load(self) -> list[str]:
        """Load and publish the stored plans; return a text for each plan that is lost."""
        return [fault for store in self._stores.values() if (fault := store.load())]

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle a message of the mission protocol."""
        addressed = message.target_system == self._system_id
        if not addressed or message.target_component not in _COMPONENTS:
            return []
        return self._handlers[message.get_type()](message, sender, now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Request missing items again, check complete plans, and time out uploads."""
        outgoing: list[Outgoing] = []
        for mission_type, upload in self._uploads.items():
            self._stores[mission_type].tick(now_us)
            if upload.is_receiving:
                outgoing += self._with_status_text(mission_type, upload.tick(now_us))
        return outgoing

    def resume_uploads(self, now_us: int) -> list[Outgoing]:
        """Continue the uploads whose check the navigator has answered."""
        return [
            message
            for mission_type, upload in self._uploads.items()
            if upload.is_checking
            for message in self._with_status_text(mission_type, upload.tick(now_us))
        ]

    def _count(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        upload = self._uploads.get(message.mission_type)
        if upload is None:
            return self._refuse_type(message, sender)
        self._downloads.end(sender.address, message.mission_type)
        return self._with_status_text(message.mission_type, upload.begin(message, sender, now_us))

    def _item(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        upload = self._uploads.get(message.mission_type)
        if upload is None:
            return self._refuse_type(message, sender)
        return self._with_status_text(message.mission_type, upload.item(message, sender, now_us))

    def _request_list(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        store = self._stores.get(message.mission_type)
        if store is None:
            return self._refuse_type(message, sender)
        self._downloads.begin(sender.address, message.mission_type, store.plan_id, now_us)
        answer = MissionCount(
            target_system=sender.system,
            target_component=sender.component,
            count=len(store.items),
            mission_type=message.mission_type,
            opaque_id=store.plan_id,
        )
        return [Outgoing(answer, sender.address)]

    def _request(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        store = self._stores.get(message.mission_type)
        if store is None:
            return self._refuse_type(message, sender)
        download = (sender.address, message.mission_type)
        if self._downloads.is_of_another_plan(*download, store.plan_id, now_us):
            if not self._downloads.note_refusal(*download):
                return [acknowledge(sender, _CANCELLED, message.mission_type)]
            reason = "another plan has been stored since, download it again"
            return self._refuse(message, sender, _CANCELLED, reason)
        if message.seq >= len(store.items):
            reason = f"item {message.seq} of {len(store.items)}, which begin at 0"
            return self._refuse(message, sender, mavlink.MAV_MISSION_INVALID_SEQUENCE, reason)
        answer = to_message(
            store.items[message.seq],
            message.seq,
            current=message.mission_type == _MISSION and message.seq == self._current_seq(),
            mission_type=message.mission_type,
        )
        answer.target_system, answer.target_component = sender.identity
        return [Outgoing(answer, sender.address)]

    def _clear(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Remove one plan or all three; denied while another peer uploads one of them."""
        mission_type = message.mission_type
        types = tuple(self._stores) if mission_type == _ALL_TYPES else (mission_type,)
        if mission_type not in {*self._stores, _ALL_TYPES}:
            return self._refuse_type(message, sender)
        if any(self._uploads[each].is_by_another(sender) for each in types):
            return self._refuse(message, sender, _DENIED, ANOTHER_UPLOADS)
        if any(self._stores[each].is_writing for each in types):
            return []  # The sender will repeat it
        frame = bytes(message.get_msgbuf() or b"")
        if self._is_duplicate(frame, now_us) and any(self._stores[each].items for each in types):
            return []  # A late duplicate; the plan has been replaced since
        self._cleared = (frame, now_us)
        outcomes: list[Outcome] = []

        def conclude(outcome: Outcome) -> Reply:
            """Answer once, when the last removal has ended."""
            outcomes.append(outcome)
            if len(outcomes) < len(types):
                return Reply()
            failed = [each for each in outcomes if each.result != ACCEPTED]
            worst = (failed or outcomes)[0]
            return Reply((acknowledge(sender, worst.result, mission_type),), worst.reason)

        replies = [self._uploads[each].clear(sender, now_us, conclude) for each in types]
        return [message for reply in replies for message in self._with_status_text(types[0], reply)]

    def _is_duplicate(self, frame: bytes, now_us: int) -> bool:
        """Whether a CLEAR_ALL is an identical frame to a recent one."""
        cleared, time_us = self._cleared
        return frame == cleared != b"" and now_us - time_us < DUPLICATE_US

    def _ack(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        """Handle an ACK: it ends a download, or cancels the sender's upload."""
        self._downloads.end(sender.address, message.mission_type)
        upload = self._uploads.get(message.mission_type)
        if upload is not None and message.type != ACCEPTED:
            upload.cancel(sender)
        return []

    def _partial(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        return self._refuse(message, sender, _UNSUPPORTED, "partial lists are not supported")

    def _refuse_type(self, message: Message, sender: Sender) -> list[Outgoing]:
        reason = f"mission type {message.mission_type} is unknown"
        return self._refuse(message, sender, _INVALID, reason)

    def _refuse(self, message: Message, sender: Sender, result: int, reason: str) -> list[Outgoing]:
        """Answer of a message that is refused, with the reason for the operator."""
        text = f"{message.get_type()} refused: {reason}"
        texts = self._texts.encode(mavlink.MAV_SEVERITY_WARNING, text)
        return [acknowledge(sender, result, message.mission_type), *texts]

    def _with_status_text(self, mission_type: int, reply: Reply) -> list[Outgoing]:
        """Messages of a reply, with a STATUSTEXT if there is a refusal."""
        if not reply.refusal:
            return list(reply.messages)
        text = f"{_NAMES[mission_type]} upload refused: {reply.refusal}"
        return [*reply.messages, *self._texts.encode(mavlink.MAV_SEVERITY_WARNING, text)]
