"""The receiving end of one plan's upload (mission, fence or rally points).

Sans-IO. The vehicle drives the transfer: it asks for each item, asks again when the item stays
away, and gives up after a silence. Items gather in a second slot; the stored plan stays as it
is until the last item has come and the whole plan has been accepted.

    idle       --COUNT------------------------> receiving   ask for item 0
    idle       --COUNT of 0, CLEAR_ALL--------> judging     of a plan without items
    idle       --late copy of an ended COUNT--> idle
    receiving  --COUNT, same uploader---------> receiving   begin again
    receiving  --COUNT or ITEM, somebody else-> receiving   DENIED to that one
    receiving  --ITEM expected----------------> receiving   ask for the next
    receiving  --ITEM not expected------------> receiving   ask again for the expected one
    receiving  --last ITEM--------------------> judging
    receiving  --ITEM that cannot be stored---> idle        refuse
    receiving  --ACK by the uploader----------> idle
    receiving  --15 s without progress--------> idle        OPERATION_CANCELLED, STATUSTEXT
    judging    --found good-------------------> writing
    judging    --found bad--------------------> idle        refuse
    judging    --COUNT, same uploader---------> receiving   begin again
    judging    --COUNT or ITEM, somebody else-> judging     DENIED to that one
    judging    --ACK by the uploader----------> idle
    writing    --the medium has it------------> idle        swap, ACCEPTED
    writing    --the medium refuses-----------> idle        refuse
    writing    --COUNT, CLEAR_ALL, ACK--------> writing     too late; they are sent again
    writing    --15 s without an answer-------> idle        ERROR; the former plan stays
    idle       --COUNT, CLEAR_ALL, and the
                 medium does not answer yet---> idle        ERROR
    idle       --the ITEM that ended it again-> idle        the same answer again

Judging begins at once, and a plan of some hundred items is judged in the same call. A removal
is a plan without items. What has begun to be written cannot be given up: the medium would hold
another plan than the vehicle.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.lib.stepwise import Stepwise
from uav_firmware.modules.mavlink.missions.mission_items import ItemFault, StoredItem, read_item
from uav_firmware.modules.mavlink.missions.mission_store import (
    MAX_ITEMS,
    NO_ANSWER,
    PlanStore,
    Verdict,
)
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import MissionAck

FIRST_RETRY_US: Final = 250_000
LAST_RETRY_US: Final = 1_000_000
EAGER_RETRIES: Final = 4
"""Repetitions of a request at the first interval; a ground station gives up after 1.5 s of
silence, and a lossy link needs more than two in that time. After them the interval doubles."""
SILENCE_LIMIT_US: Final = 15_000_000
ECHO_US: Final = 500_000
"""How long after a transfer a copy of what began it may still be on its way."""
JUDGING_BUDGET: Final = 400
"""Work of one call, in the unit of PlanReview: some 2 ms, half a control step."""
_REASK_US: Final = 50_000
"""Shortest time between two requests for one item, so that duplicates do not multiply."""

CANCELLED: Final[int] = mavlink.MAV_MISSION_OPERATION_CANCELLED
_DENIED: Final[int] = mavlink.MAV_MISSION_DENIED


@dataclass(slots=True)
class _Transfer:
    """An upload that is under way."""

    sender: Sender
    count: int
    opening: bytes  # The frame of its COUNT
    progress_us: int  # When the last useful message came
    asked_us: int  # When an item was last asked for
    fastest_us: int = 0  # Shortest time from a request to its item so far
    first_asked_us: int = 0  # When the item awaited was first asked for
    retries: int = 0  # How often it was asked for again
    items: list[StoredItem] = field(default_factory=list)
    judging: Stepwise[Verdict] | None = None  # When all items are here
    conclude: "Conclude | None" = None  # Of a removal: what its verdict leads to

    @property
    def retry_us(self) -> int:
        """How long [us] to wait for the item; longer than this link has been seen to need."""
        usual_us = min(self.fastest_us * 6 // 5, LAST_RETRY_US // 2)
        base_us = max(FIRST_RETRY_US, usual_us)
        return min(base_us << max(0, self.retries - EAGER_RETRIES + 1), LAST_RETRY_US)

    def take(self, item: StoredItem, now_us: int) -> None:
        """Append the item awaited, and await the next."""
        took_us = now_us - self.first_asked_us
        self.fastest_us = min(self.fastest_us, took_us) if self.items else took_us
        self.items.append(item)
        self.progress_us = self.asked_us = self.first_asked_us = now_us
        self.retries = 0


class _Ending(NamedTuple):
    """How the last transfer ended, to be told again when its last item comes again."""

    time_us: int
    opening: bytes
    identity: tuple[int, int]
    seq: int
    item: StoredItem | ItemFault
    verdict: Verdict


class Reply(NamedTuple):
    """What a message or a tick leads to."""

    messages: tuple[Outgoing, ...] = ()
    refusal: str = ""  # A sentence for the operator


Conclude: TypeAlias = Callable[[Verdict], Reply]


class UploadReceiver:
    """Receives uploads of one mission type."""

    def __init__(self, mission_type: int, store: PlanStore) -> None:
        self._mission_type = mission_type
        self._store = store
        self._transfer: _Transfer | None = None
        self._ending: _Ending | None = None

    @property
    def is_receiving(self) -> bool:
        """Whether a transfer is under way."""
        return self._transfer is not None

    def is_foreign(self, sender: Sender) -> bool:
        """Whether somebody else is uploading."""
        return self._transfer is not None and self._transfer.sender.identity != sender.identity

    def begin(self, message: Message, sender: Sender, now_us: int) -> Reply:
        """Take MISSION_COUNT."""
        opening = bytes(message.get_msgbuf() or b"")
        if self.is_foreign(sender):
            return Reply((self._ack(sender, Verdict(_DENIED)),))
        if self._is_echo(opening, now_us) or self._store.is_writing:
            return Reply()
        if self._store.is_stuck:
            self._transfer = None
            return self._answer(sender, NO_ANSWER)
        if message.count > MAX_ITEMS:
            self._transfer = None
            verdict = Verdict(mavlink.MAV_MISSION_NO_SPACE)
            text = f"{message.count} items, {MAX_ITEMS} fit"
            return Reply((self._ack(sender, verdict),), text)
        if message.count == 0:
            return self.clear(sender, now_us, lambda verdict: self._answer(sender, verdict))
        self._ending = None
        self._transfer = _Transfer(
            sender, message.count, opening, now_us, now_us, first_asked_us=now_us
        )
        return Reply((self._request(self._transfer),))

    def clear(self, sender: Sender, now_us: int, conclude: Conclude) -> Reply:
        """Remove the plan, and end an upload of it; the reply comes now or from a tick."""
        removal = Stepwise(self._store.accept((), now_us))
        self._ending = None
        self._transfer = _Transfer(
            sender, 0, b"", now_us, now_us, judging=removal, conclude=conclude
        )
        return self._judge(self._transfer, removal, now_us)

    def item(self, message: Message, sender: Sender, now_us: int) -> Reply:
        """Take MISSION_ITEM_INT or MISSION_ITEM."""
        transfer = self._transfer
        if transfer is None or transfer.sender.identity != sender.identity:
            return self._unexpected(message, sender)
        if transfer.judging is not None:
            return Reply()
        if message.seq != len(transfer.items):
            return self._ask_again(transfer, now_us)
        item = self._readable(message)
        if isinstance(item, ItemFault):
            verdict = Verdict(item.result, reason=f"item {message.seq}: {item.reason}")
            return self._end(transfer, item, verdict, now_us)
        transfer.take(item, now_us)
        if len(transfer.items) < transfer.count:
            return Reply((self._request(transfer),))
        transfer.judging = Stepwise(self._store.accept(transfer.items, now_us))
        return self._judge(transfer, transfer.judging, now_us)

    def cancel(self, sender: Sender) -> None:
        """Take a MISSION_ACK by the uploader: it ends its upload."""
        if self.is_foreign(sender) or self._store.is_writing:
            return
        self._transfer = None

    def tick(self, now_us: int) -> Reply:
        """Judge, ask again, or give up."""
        transfer = self._transfer
        if transfer is None:
            return Reply()
        if transfer.judging is not None:
            return self._judge(transfer, transfer.judging, now_us)
        if now_us - transfer.progress_us >= SILENCE_LIMIT_US:
            self._transfer = None
            text = f"item {len(transfer.items)} of {transfer.count} did not arrive"
            return Reply((self._ack(transfer.sender, Verdict(CANCELLED)),), text)
        if now_us - transfer.asked_us < transfer.retry_us:
            return Reply()
        transfer.asked_us = now_us
        transfer.retries += 1
        return Reply((self._request(transfer),))

    def _is_echo(self, opening: bytes, now_us: int) -> bool:
        """Whether a COUNT is a late copy, frame number and all, of one that has been served."""
        ending = self._ending
        return (
            self._transfer is None
            and ending is not None
            and opening == ending.opening != b""
            and now_us - ending.time_us < ECHO_US
        )

    def _readable(self, message: Message) -> StoredItem | ItemFault:
        item = read_item(message)
        if isinstance(item, ItemFault):
            return item
        return self._store.fault_of(message.seq, item) or item

    def _unexpected(self, message: Message, sender: Sender) -> Reply:
        """An item out of any transfer of its sender's: the last one again, or a stray."""
        ending = self._ending
        if ending is not None and (sender.identity, message.seq) == (ending.identity, ending.seq):
            same = _as_text(self._readable(message)) == _as_text(ending.item)
            return Reply((self._ack(sender, ending.verdict),)) if same else Reply()
        busy = self._transfer is not None
        return Reply((self._ack(sender, Verdict(_DENIED)),)) if busy else Reply()

    def _ask_again(self, transfer: _Transfer, now_us: int) -> Reply:
        if now_us - transfer.asked_us < _REASK_US:
            return Reply()
        transfer.asked_us = now_us
        return Reply((self._request(transfer),))

    def _judge(self, transfer: _Transfer, judging: Stepwise[Verdict], now_us: int) -> Reply:
        if not judging.advance(JUDGING_BUDGET):
            return Reply()
        if transfer.conclude is None:
            return self._end(transfer, transfer.items[-1], judging.result, now_us)
        self._transfer = None
        return transfer.conclude(judging.result)

    def _end(
        self, transfer: _Transfer, item: StoredItem | ItemFault, verdict: Verdict, now_us: int
    ) -> Reply:
        sender = transfer.sender
        seq = len(transfer.items) - (not isinstance(item, ItemFault))
        self._transfer = None
        self._ending = _Ending(now_us, transfer.opening, sender.identity, seq, item, verdict)
        return self._answer(sender, verdict)

    def _answer(self, sender: Sender, verdict: Verdict) -> Reply:
        return Reply((self._ack(sender, verdict),), verdict.reason)

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
