"""Server of the parameter protocol as in PX4: INT32 and REAL32, bytewise encoding, hash.

Sans-IO. The list begins with `_HASH_CHECK`: CRC32 over the sorted names and raw values of all
parameters that are not volatile. A ground station with these values in its cache answers with
PARAM_SET `_HASH_CHECK`, which stops the list.
"""

import struct
import zlib
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from uav_firmware.bus import Queue
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import (
    MAV_PARAM_ERROR_TYPE_MISMATCH,
    ParamValue,
    raw_param_value,
)
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.status import ParameterSaveRequest, ParameterSaveResult
from uav_firmware.parameters import (
    ParameterError,
    ParameterLockedError,
    ParameterRangeError,
    ParameterTypeError,
    Registry,
    UnknownParameterError,
)

HASH_NAME: Final = "_HASH_CHECK"
VALUES_PER_SECOND: Final = 1000
"""Rate of the list in vehicle time: 40 kB/s, a third of a 1 Mbit/s link."""
_MAX_VALUES_PER_TICK: Final = 40
REFUSED_VALUE_AFTER_US: Final = 200_000
"""Vehicle time between the PARAM_ERROR of a refused PARAM_SET and the value that stays.

QGroundControl 5 and MAVProxy know no PARAM_ERROR and need the value; they wait a second for it.
MAVSDK ends the request with the error. A value that arrives while its next one runs is for MAVSDK
the answer to that: it repeats PARAM_SET, and the second answer ends the request after that.
"""
_NO_INDEX: Final = 0xFFFF
_INT32: Final[int] = mavlink.MAV_PARAM_TYPE_INT32
_REAL32: Final[int] = mavlink.MAV_PARAM_TYPE_REAL32
_UINT32: Final[int] = mavlink.MAV_PARAM_TYPE_UINT32
_DOES_NOT_EXIST: Final[int] = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
_READ_ONLY: Final[int] = mavlink.MAV_PARAM_ERROR_READ_ONLY
_PERMISSION_DENIED: Final[int] = mavlink.MAV_PARAM_ERROR_PERMISSION_DENIED
_OUT_OF_RANGE: Final[int] = mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
_ERROR_CODES: Final[Mapping[type[ParameterError], int]] = {
    UnknownParameterError: _DOES_NOT_EXIST,
    ParameterRangeError: _OUT_OF_RANGE,
    ParameterTypeError: MAV_PARAM_ERROR_TYPE_MISMATCH,
    ParameterLockedError: _PERMISSION_DENIED,
}


@dataclass(slots=True)
class _Listing:
    """A list in progress to one peer."""

    next_index: int
    sent_us: int


class ParameterServer:
    """Serves PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET."""

    def __init__(
        self,
        *,
        system_id: int,
        registry: Registry,
        save_request: Queue[ParameterSaveRequest],
        request_ids: Iterator[int],
        texts: StatusTexts,
    ) -> None:
        """After each change a save is requested with the next of `request_ids`."""
        self._system_id = system_id
        self._registry = registry
        self._save_request = save_request
        self._request_ids = request_ids
        self._saving: set[int] = set()  # Ids of the requests without a result
        self._texts = texts
        self._listings: dict[Address, _Listing] = {}
        self._names: list[str] = []
        self._indices: dict[str, int] = {}
        self._changed: deque[str] = deque()
        self._refused: dict[tuple[Address, str], int] = {}  # Values to send, and when

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle a message of the parameter protocol."""
        if not is_for_us(message, self._system_id):
            return []
        self._index_names()
        if message.get_type() == "PARAM_REQUEST_LIST":
            self._listings[sender.address] = _Listing(next_index=0, sent_us=now_us)
            return [Outgoing(self._hash_value(), sender.address)]
        if message.get_type() == "PARAM_SET":
            return self._set(message, sender, now_us)
        return self._read(message, sender)

    def tick(self, now_us: int) -> list[Outgoing]:
        """Send the next values of lists and changes."""
        if own := self._registry.take_put_back():
            self._index_names()
            self._changed.extend(own)
        outgoing = [*self._next_changes(), *self._refused_values(now_us)]
        for address, listing in list(self._listings.items()):
            due = (now_us - listing.sent_us) * VALUES_PER_SECOND // 1_000_000
            if due == 0:
                continue
            listing.sent_us = now_us
            end = listing.next_index + min(due, _MAX_VALUES_PER_TICK)
            names = self._names[listing.next_index : end]
            outgoing += [Outgoing(self._value(name), address) for name in names]
            listing.next_index = end
            if end >= len(self._names):
                del self._listings[address]
        return outgoing

    def on_file_upload(self, names: Iterable[str]) -> None:
        """Save parameters set by a file, and send them to every peer over the next ticks."""
        self._index_names()
        self._changed.extend(names)
        self._request_save()

    def on_save_result(self, result: ParameterSaveResult) -> list[Outgoing]:
        """A STATUSTEXT when a requested save has failed."""
        if result.request_id not in self._saving:
            return []
        self._saving.remove(result.request_id)
        if not result.fault:
            return []
        text = f"Parameters not saved: {result.fault}"
        return self._texts.encode(mavlink.MAV_SEVERITY_WARNING, text)

    def drop_peer(self, address: Address) -> None:
        """Stop the list to a peer whose channel is closed."""
        self._listings.pop(address, None)
        self._refused = {key: due for key, due in self._refused.items() if key[0] != address}

    def hash_value(self) -> int:
        """CRC32 over the parameters as in PX4 and QGroundControl: without inversion."""
        state = 0xFFFFFFFF  # zlib inverts at both ends; starting inverted undoes the first
        for name in self._registry.names():
            if not self._registry.declaration(name).is_volatile:
                state = zlib.crc32(name.encode("ascii") + self._raw(name), state)
        return state ^ 0xFFFFFFFF

    def _next_changes(self) -> list[Outgoing]:
        """Next changed values for every peer."""
        count = min(len(self._changed), _MAX_VALUES_PER_TICK)
        return [Outgoing(self._value(self._changed.popleft())) for _ in range(count)]

    def _refused_values(self, now_us: int) -> list[Outgoing]:
        """Present values for those whose PARAM_SET was refused a moment ago."""
        due = [key for key, due_us in self._refused.items() if now_us >= due_us]
        for key in due:
            del self._refused[key]
        return [Outgoing(self._value(name), address) for address, name in due]

    def _index_names(self) -> None:
        """Index the parameters; repeated when more are registered."""
        names = self._registry.names()
        if len(names) != len(self._names):
            self._names = names
            self._indices = {name: i for i, name in enumerate(names)}

    def _read(self, message: Message, sender: Sender) -> list[Outgoing]:
        if message.param_index == -1:
            name = message.param_id
            if name == HASH_NAME:
                return [Outgoing(self._hash_value(), sender.address)]
            known = name in self._indices
        else:
            known = 0 <= message.param_index < len(self._names)
            name = self._names[message.param_index] if known else message.param_id
        if not known:
            return [self._error(name, message.param_index, _DOES_NOT_EXIST, sender)]
        self._refused.pop((sender.address, name), None)
        return [Outgoing(self._value(name), sender.address)]

    def _set(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        name: str = message.param_id
        if name == HASH_NAME:
            self.drop_peer(sender.address)
            return []
        self._refused.pop((sender.address, name), None)  # This request has its own answer
        fault = self._change(name, message)
        if fault is None:
            self._request_save()
            return [Outgoing(self._value(name))]
        if name in self._indices:
            self._refused[sender.address, name] = now_us + REFUSED_VALUE_AFTER_US
        return [self._error(name, self._indices.get(name, -1), fault, sender)]

    def _change(self, name: str, message: Message) -> int | None:
        """Change a value; return a MAV_PARAM_ERROR when it is refused."""
        try:
            declaration = self._registry.declaration(name)
            value = _carried_value(message, is_integer=declaration.is_integer)
            if value is None:
                return MAV_PARAM_ERROR_TYPE_MISMATCH
            if declaration.is_read_only:
                return None if value == self._registry.get(name) else _READ_ONLY
            self._registry.set(name, value)
        except ParameterError as error:
            return _ERROR_CODES.get(type(error), _OUT_OF_RANGE)
        return None

    def _request_save(self) -> None:
        request_id = next(self._request_ids)
        self._saving.add(request_id)
        self._save_request.publish(ParameterSaveRequest(request_id))

    def _raw(self, name: str) -> bytes:
        """The four bytes of a value."""
        value = self._registry.get(name)
        is_integer = self._registry.declaration(name).is_integer
        return struct.pack("<i", int(value)) if is_integer else struct.pack("<f", value)

    def _value(self, name: str) -> Message:
        is_integer = self._registry.declaration(name).is_integer
        return _param_value(
            name,
            self._raw(name),
            _INT32 if is_integer else _REAL32,
            len(self._names),
            self._indices[name],
        )

    def _hash_value(self) -> Message:
        raw = struct.pack("<I", self.hash_value())
        return _param_value(HASH_NAME, raw, _UINT32, len(self._names), _NO_INDEX)

    def _error(self, name: str, index: int, code: int, sender: Sender) -> Outgoing:
        message = mavlink.MAVLink_param_error_message(
            target_system=sender.system,
            target_component=sender.component,
            param_id=name.encode("ascii", errors="replace")[:16],
            param_index=index,
            error=code,
        )
        return Outgoing(message, sender.address)


def _carried_value(message: Message, *, is_integer: bool) -> float | None:
    """Value of a PARAM_SET; None when its type does not match.

    An integer as REAL32 also sets an INT32, as MAVProxy sends it after reading the parameter file.
    The bits of a small INT32 other than 0 are not an integer as REAL32, so this is unambiguous.
    """
    raw = raw_param_value(message)
    if is_integer and message.param_type == _INT32:
        return int.from_bytes(raw, "little", signed=True)
    if message.param_type != _REAL32:
        return None
    (value,) = struct.unpack("<f", raw)
    if not is_integer:
        return float(value)
    return int(value) if value.is_integer() else None


def _param_value(name: str, raw: bytes, kind: int, count: int, index: int) -> Message:
    """PARAM_VALUE whose float field holds four raw bytes."""
    return ParamValue(
        param_id=name.encode("ascii"),
        param_value=raw,
        param_type=kind,
        param_count=count,
        param_index=index,
    )
