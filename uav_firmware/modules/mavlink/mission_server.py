"""The mission protocol's vehicle end: three plans, their uploads, downloads and removal.

Sans-IO. A download is stateless: any item may be asked for in any order, any number of times,
by several peers at once, also while an upload is under way. Fence and rally points have no user
on board yet: uploads of them are refused as UNSUPPORTED and downloads are empty, so that nobody
believes in a fence that is not there.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.modules.mavlink.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.dialect import Message, mavlink
from uav_firmware.modules.mavlink.dialect_extensions import MissionCount
from uav_firmware.modules.mavlink.mission_items import (
    StoredItem,
    for_navigator,
    plan_id,
    to_message,
)
from uav_firmware.modules.mavlink.mission_upload import (
    ACCEPTED,
    UploadReceiver,
    Verdict,
    acknowledge,
)
from uav_firmware.modules.mavlink.status_text import StatusTexts
from uav_firmware.msg.mission import MissionItem, MissionRejection

MAX_ITEMS: Final = 2000
_MISSION: Final[int] = mavlink.MAV_MISSION_TYPE_MISSION
_TYPES: Final[tuple[int, ...]] = (
    _MISSION,
    mavlink.MAV_MISSION_TYPE_FENCE,
    mavlink.MAV_MISSION_TYPE_RALLY,
)
_ALL_TYPES: Final[int] = mavlink.MAV_MISSION_TYPE_ALL
_INVALID: Final[int] = mavlink.MAV_MISSION_INVALID
_UNSUPPORTED: Final[int] = mavlink.MAV_MISSION_UNSUPPORTED
_NAMES: Final = ("Mission", "Geofence", "Rally points")
_COMPONENTS: Final = frozenset({0, 1, mavlink.MAV_COMP_ID_MISSIONPLANNER})


Plan: TypeAlias = tuple[int, int, tuple[MissionItem, ...]]
"""Time of acceptance [us], id, items."""


class PlanStore(NamedTuple):
    """What becomes of one kind of plan."""

    check: Callable[[Sequence[MissionItem]], MissionRejection | None]  # Before it is accepted
    publish: Callable[[Plan], None]


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
        """Publish empty plans.

        Args:
            system_id: System that messages must name.
            stores: What becomes of the plans, by MAV_MISSION_TYPE.
            current_seq: Gives the item that the navigator flies.
            texts: Where sentences for the operator go.
        """
        self._system_id = system_id
        self._stores = stores
        self._current_seq = current_seq
        self._texts = texts
        self._plans: dict[int, tuple[StoredItem, ...]] = dict.fromkeys(_TYPES, ())
        self._uploads = {
            mission_type: UploadReceiver(
                mission_type,
                limit=MAX_ITEMS,
                accept=partial(self._accept, mission_type),
            )
            for mission_type in _TYPES
        }
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
        for store in stores.values():
            store.publish((0, 0, ()))

    @property
    def message_types(self) -> frozenset[str]:
        """Names of the messages that `handle` takes."""
        return frozenset(self._handlers)

    @property
    def mission_length(self) -> int:
        """Number of items of the stored mission."""
        return len(self._plans[_MISSION])

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take a message of the mission protocol."""
        addressed = message.target_system == self._system_id
        if not addressed or message.target_component not in _COMPONENTS:
            return []
        return self._handlers[message.get_type()](message, sender, now_us)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Ask again for items that stay away, end uploads that have fallen silent."""
        outgoing: list[Outgoing] = []
        for mission_type, upload in self._uploads.items():
            if upload.is_receiving:
                outgoing += self._told(mission_type, *upload.tick(now_us))
        return outgoing

    def _count(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        mission_type = message.mission_type
        if mission_type not in _TYPES:
            return [acknowledge(sender, _INVALID, mission_type)]
        upload = self._uploads[mission_type]
        return self._told(mission_type, *upload.begin(message.count, sender, now_us))

    def _item(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        upload = self._uploads.get(message.mission_type)
        if upload is None:
            return [acknowledge(sender, _INVALID, message.mission_type)]
        return self._told(message.mission_type, *upload.item(message, sender, now_us))

    def _request_list(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        plan = self._plans.get(message.mission_type)
        if plan is None:
            return [acknowledge(sender, _INVALID, message.mission_type)]
        answer = MissionCount(
            target_system=sender.system,
            target_component=sender.component,
            count=len(plan),
            mission_type=message.mission_type,
            opaque_id=plan_id(plan),
        )
        return [Outgoing(answer, sender.address)]

    def _request(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        plan = self._plans.get(message.mission_type)
        if plan is None:
            return [acknowledge(sender, _INVALID, message.mission_type)]
        if message.seq >= len(plan):
            refused = mavlink.MAV_MISSION_INVALID_SEQUENCE
            return [acknowledge(sender, refused, message.mission_type)]
        answer = to_message(
            plan[message.seq],
            message.seq,
            current=message.mission_type == _MISSION and message.seq == self._current_seq(),
            mission_type=message.mission_type,
        )
        answer.target_system, answer.target_component = sender.identity
        return [Outgoing(answer, sender.address)]

    def _clear(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        mission_type = message.mission_type
        if mission_type not in {*_TYPES, _ALL_TYPES}:
            return [acknowledge(sender, _INVALID, mission_type)]
        types = _TYPES if mission_type == _ALL_TYPES else (mission_type,)
        refused: list[Outgoing] = []
        for each in types:
            # An upload of nothing: the same rules, and a running foreign upload is kept.
            messages, _ = self._uploads[each].begin(0, sender, now_us)
            refused += [m for m in messages if m.message.type != ACCEPTED]
        result = refused[0].message.type if refused else ACCEPTED
        return [acknowledge(sender, result, mission_type)]

    def _ack(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        """An ACK ends a download (nothing to do) or cancels the sender's own upload."""
        upload = self._uploads.get(message.mission_type)
        if upload is not None and message.type != ACCEPTED:
            upload.cancel(sender)
        return []

    def _partial(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        return [acknowledge(sender, _UNSUPPORTED, message.mission_type)]

    def _accept(self, mission_type: int, items: Sequence[StoredItem], now_us: int) -> Verdict:
        """Check a whole plan and put it in the place of the former one."""
        for_flight, store = for_navigator(items), self._stores[mission_type]
        rejection = store.check(for_flight) if items else None
        if rejection is not None:
            return Verdict(rejection.result, reason=f"item {rejection.seq}: {rejection.reason}")
        identifier = plan_id(items)
        self._plans[mission_type] = tuple(items)
        store.publish((now_us, identifier, for_flight))
        return Verdict(ACCEPTED, identifier)

    def _told(self, mission_type: int, messages: list[Outgoing], reason: str) -> list[Outgoing]:
        """Add a STATUSTEXT to messages where there is a reason for one."""
        if not reason:
            return messages
        text = f"{_NAMES[mission_type]} upload refused: {reason}"
        return [*messages, *self._texts.say(mavlink.MAV_SEVERITY_WARNING, text)]
