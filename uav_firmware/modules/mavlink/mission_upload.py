"""The receiving end of one plan's upload (mission, fence or rally points).

Sans-IO. The vehicle drives the transfer: it asks for each item, asks again when the item stays
away, and gives up after a silence. Items gather in a second slot; the stored plan stays as it
is until the last item has come and the whole plan has been accepted.

    idle       --COUNT------------------------> receiving   ask for item 0
    receiving  --COUNT, same uploader---------> receiving   begin again
    receiving  --COUNT or ITEM, somebody else-> receiving   DENIED to that one
    receiving  --ITEM expected----------------> receiving   ask for the next
    receiving  --ITEM not expected------------> receiving   ask again for the expected one
    receiving  --last ITEM--------------------> idle        swap, ACCEPTED; or refuse
    receiving  --ITEM that cannot be stored---> idle        refuse
    receiving  --ACK by the uploader----------> idle
    receiving  --15 s without progress--------> idle        OPERATION_CANCELLED, STATUSTEXT
    idle       --the ITEM that ended it again-> idle        the same answer again
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.modules.mavlink.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.dialect import Message, mavlink
from uav_firmware.modules.mavlink.dialect_extensions import MissionAck
from uav_firmware.modules.mavlink.mission_items import ItemFault, StoredItem, read_item

FIRST_RETRY_US: Final = 250_000
LAST_RETRY_US: Final = 1_000_000
SILENCE_LIMIT_US: Final = 15_000_000
_REASK_US: Final = 50_000
"""Shortest time between two requests for one item, so that duplicates do not multiply."""

ACCEPTED: Final[int] = mavlink.MAV_MISSION_ACCEPTED
CANCELLED: Final[int] = mavlink.MAV_MISSION_OPERATION_CANCELLED
_DENIED: Final[int] = mavlink.MAV_MISSION_DENIED


class Verdict(NamedTuple):
    """What became of a whole plan."""

    result: int  # MAV_MISSION_RESULT
    plan_id: int = 0  # Of the plan stored, when accepted
    reason: str = ""  # For the operator, when refused


Accept: TypeAlias = Callable[[Sequence[StoredItem], int], Verdict]
"""Stores a whole plan, or refuses it; takes the items and the time [us]."""


@dataclass(slots=True)
class _Transfer:
    """An upload that is under way."""

    sender: Sender
    count: int
    progress_us: int  # When the last useful message came
    asked_us: int  # When an item was last asked for
    retry_us: int = FIRST_RETRY_US
    items: list[StoredItem] = field(default_factory=list)


class _Ending(NamedTuple):
    """How the last transfer ended, to be told again when its last item comes again."""

    identity: tuple[int, int]
    seq: int
    item: StoredItem | ItemFault
    verdict: Verdict


class UploadReceiver:
    """Receives uploads of one mission type."""

    def __init__(self, mission_type: int, *, limit: int, accept: Accept) -> None:
        """Take the greatest number of items, and what to do with a whole plan."""
        self._mission_type = mission_type
        self._limit = limit
        self._accept = accept
        self._transfer: _Transfer | None = None
        self._ending: _Ending | None = None

    @property
    def is_receiving(self) -> bool:
        """Whether a transfer is under way."""
        return self._transfer is not None

    def begin(self, count: int, sender: Sender, now_us: int) -> tuple[list[Outgoing], str]:
        """Take MISSION_COUNT; gives the messages to send and a sentence for the operator."""
        if self._is_foreign(sender):
            return [self._ack(sender, Verdict(_DENIED))], ""
        if count > self._limit:
            self._transfer = None
            verdict = Verdict(mavlink.MAV_MISSION_NO_SPACE)
            return [self._ack(sender, verdict)], f"{count} items, {self._limit} fit"
        self._ending = None
        if count == 0:
            self._transfer = None
            verdict = self._accept((), now_us)
            return [self._ack(sender, verdict)], verdict.reason
        self._transfer = _Transfer(sender, count, progress_us=now_us, asked_us=now_us)
        return [self._request(self._transfer)], ""

    def item(self, message: Message, sender: Sender, now_us: int) -> tuple[list[Outgoing], str]:
        """Take MISSION_ITEM_INT or MISSION_ITEM; gives messages and a sentence as `begin`."""
        transfer = self._transfer
        if transfer is None or transfer.sender.identity != sender.identity:
            return self._unexpected(message, sender), ""
        if message.seq != len(transfer.items):
            return self._ask_again(transfer, now_us), ""
        item = read_item(message)
        if isinstance(item, ItemFault):
            verdict = Verdict(item.result, reason=f"item {message.seq}: {item.reason}")
            return self._end(transfer, message.seq, item, verdict)
        transfer.items.append(item)
        transfer.progress_us = transfer.asked_us = now_us
        transfer.retry_us = FIRST_RETRY_US
        if len(transfer.items) < transfer.count:
            return [self._request(transfer)], ""
        return self._end(transfer, message.seq, item, self._accept(transfer.items, now_us))

    def cancel(self, sender: Sender) -> None:
        """Take a MISSION_ACK by the uploader: it ends its upload."""
        if self._transfer is not None and not self._is_foreign(sender):
            self._transfer = None

    def tick(self, now_us: int) -> tuple[list[Outgoing], str]:
        """Ask again, or give up; gives messages and a sentence as `begin`."""
        transfer = self._transfer
        if transfer is None:
            return [], ""
        if now_us - transfer.progress_us >= SILENCE_LIMIT_US:
            self._transfer = None
            text = f"item {len(transfer.items)} of {transfer.count} did not arrive"
            return [self._ack(transfer.sender, Verdict(CANCELLED))], text
        if now_us - transfer.asked_us < transfer.retry_us:
            return [], ""
        transfer.asked_us = now_us
        transfer.retry_us = min(2 * transfer.retry_us, LAST_RETRY_US)
        return [self._request(transfer)], ""

    def _is_foreign(self, sender: Sender) -> bool:
        return self._transfer is not None and self._transfer.sender.identity != sender.identity

    def _unexpected(self, message: Message, sender: Sender) -> list[Outgoing]:
        """An item out of any transfer of its sender's: the last one again, or a stray."""
        ending = self._ending
        if ending is not None and (sender.identity, message.seq) == ending[:2]:
            same = _as_text(read_item(message)) == _as_text(ending.item)
            return [self._ack(sender, ending.verdict)] if same else []
        return [self._ack(sender, Verdict(_DENIED))] if self._transfer is not None else []

    def _ask_again(self, transfer: _Transfer, now_us: int) -> list[Outgoing]:
        if now_us - transfer.asked_us < _REASK_US:
            return []
        transfer.asked_us = now_us
        return [self._request(transfer)]

    def _end(
        self, transfer: _Transfer, seq: int, item: StoredItem | ItemFault, verdict: Verdict
    ) -> tuple[list[Outgoing], str]:
        self._transfer = None
        self._ending = _Ending(transfer.sender.identity, seq, item, verdict)
        return [self._ack(transfer.sender, verdict)], verdict.reason

    def _request(self, transfer: _Transfer) -> Outgoing:
        message = mavlink.MAVLink_mission_request_int_message(
            target_system=transfer.sender.system,
            target_component=transfer.sender.component,
            seq=len(transfer.items),
            mission_type=self._mission_type,
        )
        return Outgoing(message, transfer.sender.address)

    def _ack(self, sender: Sender, verdict: Verdict) -> Outgoing:
        return acknowledge(sender, verdict.result, self._mission_type, verdict.plan_id)


def acknowledge(sender: Sender, result: int, mission_type: int, plan_id: int = 0) -> Outgoing:
    """MISSION_ACK to a sender."""
    message = MissionAck(
        target_system=sender.system,
        target_component=sender.component,
        type=result,
        mission_type=mission_type,
        opaque_id=plan_id,
    )
    return Outgoing(message, sender.address)


def _as_text(item: StoredItem | ItemFault) -> str:
    """Comparable form of an item, in which NaN equals NaN."""
    return repr(item)
