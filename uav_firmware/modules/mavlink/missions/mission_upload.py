"""Receiver of an upload of one plan (mission, fence or rally points).

Sans-IO. The vehicle requests each item, retries, and times out. The stored plan stays until the
last item has arrived and the whole plan has been accepted.

    idle       --COUNT------------------------> receiving   request item 0
    idle       --COUNT of 0, CLEAR_ALL--------> checking    a plan without items
    idle       --duplicate of an ended COUNT--> idle
    receiving  --COUNT, same uploader---------> receiving   start again
    receiving  --COUNT or ITEM, another peer--> receiving   DENIED to that peer
    receiving  --ITEM expected----------------> receiving   request the next
    receiving  --ITEM not expected------------> receiving   request the expected one
    receiving  --ITEM from another address----> receiving   ignored: another with the same ids
    receiving  --last ITEM--------------------> checking
    receiving  --invalid ITEM-----------------> idle        refuse
    receiving  --ACK by the uploader----------> idle
    receiving  --15 s without progress--------> idle        OPERATION_CANCELLED, STATUSTEXT
    checking   --accepted---------------------> writing
    checking   --refused----------------------> idle        refuse
    checking   --COUNT, same uploader---------> receiving   start again
    checking   --duplicate of its COUNT-------> checking
    checking   --COUNT or ITEM, another peer--> checking    DENIED to that peer
    checking   --ACK by the uploader----------> idle
    writing    --write done-------------------> idle        replace, ACCEPTED
    writing    --write failed-----------------> idle        refuse
    writing    --COUNT, CLEAR_ALL, ACK--------> writing     ignored, the sender repeats them
    writing    --write timed out, 15 s--------> idle        ERROR; the previous plan stays
    idle       --COUNT, CLEAR_ALL, and a
                 write still in progress------> idle        ERROR
    idle       --last ITEM repeated-----------> idle        the same answer

The check starts at once; a plan of about a hundred items is checked in the same step. A removal is
a plan without items. A write cannot be cancelled, because the storage would have another plan than
the vehicle.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.lib.stepwise import Stepwise
from uav_firmware.modules.mavlink.missions.mission_items import ItemFault, StoredItem, read_item
from uav_firmware.modules.mavlink.missions.mission_store import (
    MAX_ITEMS,
    STORAGE_TIMEOUT,
    Outcome,
    PlanStore,
)
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import MissionAck
from uav_firmware.msg.mission import about_item

FIRST_RETRY_US: Final = 250_000
LAST_RETRY_US: Final = 1_000_000
FAST_RETRIES: Final = 4
"""Retries at the first interval, then it doubles. A ground station times out after 1.5 s, and a
lossy link needs more than two retries in that time."""
TIMEOUT_US: Final = 15_000_000
DUPLICATE_US: Final = 500_000
"""Time after a transfer in which a duplicate of its first message may arrive."""
CHECK_BUDGET: Final = 400
"""Work of one call, in the unit of PlanReview: about 2 ms, half a control step."""
_REQUEST_INTERVAL_MIN_US: Final = 50_000
"""Shortest interval between requests for an item, so that duplicates do not multiply."""

ANOTHER_UPLOADS: Final = "another peer uploads a plan"
CANCELLED: Final[int] = mavlink.MAV_MISSION_OPERATION_CANCELLED
_DENIED: Final[int] = mavlink.MAV_MISSION_DENIED


@dataclass(slots=True)
class _Transfer:
    """An upload in progress."""

    sender: Sender
    count: int
    opening: bytes  # Frame of its COUNT
    progress_us: int  # Time of the last useful message
    requested_us: int  # Time of the last request
    fastest_us: int = 0  # Shortest time from request to item
    first_requested_us: int = 0  # Time of the first request of the expected item
    retries: int = 0  # Of the expected item
    items: list[StoredItem] = field(default_factory=list)
    check: Stepwise[Outcome] | None = None  # Once all items have arrived
    conclude: "Conclude | None" = None  # Of a removal: makes the reply

    @property
    def retry_us(self) -> int:
        """Time [us] to the next retry, longer than the round trip of this link."""
        usual_us = min(self.fastest_us * 6 // 5, LAST_RETRY_US // 2)
        base_us = max(FIRST_RETRY_US, usual_us)
        return min(base_us << max(0, self.retries - FAST_RETRIES + 1), LAST_RETRY_US)

    def take(self, item: StoredItem, now_us: int) -> None:
        """Append the expected item, and expect the next."""
        took_us = now_us - self.first_requested_us
        self.fastest_us = min(self.fastest_us, took_us) if self.items else took_us
        self.items.append(item)
        self.progress_us = self.requested_us = self.first_requested_us = now_us
        self.retries = 0


class _LastTransfer(NamedTuple):
    """Result of the last transfer, sent again when its last item is repeated."""

    time_us: int
    opening: bytes
    identity: tuple[int, int]
    seq: int
    item: StoredItem | ItemFault
    outcome: Outcome


class Reply(NamedTuple):
    """Reaction to a message or a tick."""

    messages: tuple[Outgoing, ...] = ()
    refusal: str = ""  # Text for the operator


Conclude: TypeAlias = Callable[[Outcome], Reply]


class UploadReceiver:
    """Receives uploads of one mission type."""

    def __init__(self, mission_type: int, store: PlanStore) -> None:
        self._mission_type = mission_type
        self._store = store
        self._transfer: _Transfer | None = None
        self._last_transfer: _LastTransfer | None = None

    @property
    def is_checking(self) -> bool:
        """Whether a complete plan is being checked or written."""
        return self._transfer is not None and self._transfer.check is not None

    @property
    def is_receiving(self) -> bool:
        """Whether a transfer is in progress."""
        return self._transfer is not None

    def is_by_another(self, sender: Sender) -> bool:
        """Whether another peer is uploading."""
        return self._transfer is not None and self._transfer.sender.identity != sender.identity

    def begin(self, message: Message, sender: Sender, now_us: int) -> Reply:
        """Handle MISSION_COUNT."""
        opening = bytes(message.get_msgbuf() or b"")
        if self.is_by_another(sender):
            return self._answer(sender, Outcome(_DENIED, reason=ANOTHER_UPLOADS))
        if self._is_duplicate(opening, now_us) or self._store.is_writing:
            return Reply()
        if self._store.is_blocked:
            self._transfer = None
            return self._answer(sender, STORAGE_TIMEOUT)
        if message.count > MAX_ITEMS:
            self._transfer = None
            outcome = Outcome(mavlink.MAV_MISSION_NO_SPACE)
            text = f"{message.count} items, limit {MAX_ITEMS}"
            return Reply((self._ack(sender, outcome),), text)
        if message.count == 0:
            return self.clear(sender, now_us, lambda outcome: self._answer(sender, outcome))
        self._last_transfer = None
        self._transfer = _Transfer(
            sender, message.count, opening, now_us, now_us, first_requested_us=now_us
        )
        return Reply((self._request(self._transfer),))

    def clear(self, sender: Sender, now_us: int, conclude: Conclude) -> Reply:
        """Remove the plan and cancel an upload; the reply comes now or from a tick."""
        removal = Stepwise(self._store.accept((), now_us))
        self._last_transfer = None
        self._transfer = _Transfer(sender, 0, b"", now_us, now_us, check=removal, conclude=conclude)
        return self._advance_check(self._transfer, removal, now_us)

    def item(self, message: Message, sender: Sender, now_us: int) -> Reply:
        """Handle MISSION_ITEM_INT or MISSION_ITEM."""
        transfer = self._transfer
        if transfer is None or transfer.sender.identity != sender.identity:
            return self._unexpected(message, sender)
        if transfer.check is not None or sender.address != transfer.sender.address:
            return Reply()  # Two stations have the same ids where neither has been given its own
        if message.seq != len(transfer.items):
            return self._request_again(transfer, now_us)
        item = self._readable(message)
        if isinstance(item, ItemFault):
            outcome = Outcome(item.result, reason=about_item(message.seq, item.reason))
            return self._end(transfer, item, outcome, now_us)
        transfer.take(item, now_us)
        if len(transfer.items) < transfer.count:
            return Reply((self._request(transfer),))
        transfer.check = Stepwise(self._store.accept(transfer.items, now_us))
        return self._advance_check(transfer, transfer.check, now_us)

    def cancel(self, sender: Sender) -> None:
        """Handle a MISSION_ACK of the uploader: cancel its upload."""
        transfer = self._transfer
        if transfer is not None and transfer.sender == sender and not self._store.is_writing:
            self._transfer = None

    def tick(self, now_us: int) -> Reply:
        """Continue the check, request again, or time out."""
        transfer = self._transfer
        if transfer is None:
            return Reply()
        if transfer.check is not None:
            return self._advance_check(transfer, transfer.check, now_us)
        if now_us - transfer.progress_us >= TIMEOUT_US:
            self._transfer = None
            text = f"item {len(transfer.items)} of {transfer.count} did not arrive"
            return Reply((self._ack(transfer.sender, Outcome(CANCELLED)),), text)
        if now_us - transfer.requested_us < transfer.retry_us:
            return Reply()
        transfer.requested_us = now_us
        transfer.retries += 1
        return Reply((self._request(transfer),))

    def _is_duplicate(self, opening: bytes, now_us: int) -> bool:
        """Whether a COUNT is an identical frame to that of the transfer that has all items."""
        transfer, last = self._transfer, self._last_transfer
        if transfer is not None:
            return transfer.check is not None and opening == transfer.opening != b""
        return (
            last is not None
            and opening == last.opening != b""
            and now_us - last.time_us < DUPLICATE_US
        )

    def _readable(self, message: Message) -> StoredItem | ItemFault:
        item = read_item(message)
        if isinstance(item, ItemFault):
            return item
        return self._store.fault_of(message.seq, item) or item

    def _unexpected(self, message: Message, sender: Sender) -> Reply:
        """Handle an item without a transfer of its sender: a repeated last one or another one."""
        last = self._last_transfer
        if last is not None and (sender.identity, message.seq) == (last.identity, last.seq):
            same = _as_text(self._readable(message)) == _as_text(last.item)
            return Reply((self._ack(sender, last.outcome),)) if same else Reply()
        if self._transfer is None:
            return Reply()
        return self._answer(sender, Outcome(_DENIED, reason=ANOTHER_UPLOADS))

    def _request_again(self, transfer: _Transfer, now_us: int) -> Reply:
        if now_us - transfer.requested_us < _REQUEST_INTERVAL_MIN_US:
            return Reply()
        transfer.requested_us = now_us
        return Reply((self._request(transfer),))

    def _advance_check(self, transfer: _Transfer, check: Stepwise[Outcome], now_us: int) -> Reply:
        if not check.advance(CHECK_BUDGET):
            return Reply()
        if transfer.conclude is None:
            return self._end(transfer, transfer.items[-1], check.result, now_us)
        self._transfer = None
        return transfer.conclude(check.result)

    def _end(
        self, transfer: _Transfer, item: StoredItem | ItemFault, outcome: Outcome, now_us: int
    ) -> Reply:
        sender = transfer.sender
        seq = len(transfer.items) - (not isinstance(item, ItemFault))
        self._transfer = None
        self._last_transfer = _LastTransfer(
            now_us, transfer.opening, sender.identity, seq, item, outcome
        )
        return self._answer(sender, outcome)

    def _answer(self, sender: Sender, outcome: Outcome) -> Reply:
        return Reply((self._ack(sender, outcome),), outcome.reason)

    def _request(self, transfer: _Transfer) -> Outgoing:
        message = mavlink.MAVLink_mission_request_int_message(
            target_system=transfer.sender.system,
            target_component=transfer.sender.component,
            seq=len(transfer.items),
            mission_type=self._mission_type,
        )
        return Outgoing(message, transfer.sender.address)

    def _ack(self, sender: Sender, outcome: Outcome) -> Outgoing:
        return acknowledge(sender, outcome.result, self._mission_type, outcome.plan_id)


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
    """Comparable form of an item in which NaN equals NaN."""
    return repr(item)
