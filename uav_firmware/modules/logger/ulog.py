"""ULog, version 1: messages in, bytes out.

A file is a header and then messages, each `uint16 size, uint8 type, payload`, little-endian and
without padding: definitions first (flag bits, formats, information, parameters), then
subscriptions and data. A file cut at any byte is readable up to there. Specification: PX4 User
Guide, "ULog File Format".
"""

import re
import struct
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from uav_firmware.parameters import ParameterValue

MAGIC: Final = b"\x55\x4c\x6f\x67\x01\x12\x35"
FILE_VERSION: Final = 1
SYNC_BYTES: Final = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
TEXT_MAX: Final = 1000
"""Length [bytes] to which a logged text is cut."""

_DEFAULT_PARAMETERS: Final = 1  # compatibility bit: there are messages of type Q
_SYSTEM_DEFAULT: Final = 1
_CODES: Final = {
    "int8_t": "b",
    "uint8_t": "B",
    "int16_t": "h",
    "uint16_t": "H",
    "int32_t": "i",
    "uint32_t": "I",
    "int64_t": "q",
    "uint64_t": "Q",
    "float": "f",
    "double": "d",
    "bool": "?",
}
_FIELD = re.compile(r"([a-z0-9_]+?)(?:\[(\d+)\])? ([a-z][a-zA-Z0-9_]*)")
Values = tuple[float, ...]
"""Values of a message in the order of its fields, arrays flattened."""


class FormatError(ValueError):
    """A field declaration is not valid in ULog; the message names it."""


class Field(NamedTuple):
    """One field of a format: a number or an array of numbers."""

    kind: str
    length: int
    name: str

    @property
    def declaration(self) -> str:
        """As a format message spells it."""
        array = f"[{self.length}]" if self.length > 1 else ""
        return f"{self.kind}{array} {self.name}"


def fields(declaration: str) -> tuple[Field, ...]:
    """Read `uint64_t timestamp; float[4] q`.

    Raises:
        FormatError: if a field is not valid.
    """
    return tuple(_field(part.strip()) for part in declaration.split(";"))


def _field(text: str) -> Field:
    match = _FIELD.fullmatch(text)
    if match is None or match[1] not in _CODES:
        raise FormatError(f"{text!r} is not a field of a ULog format")
    return Field(match[1], int(match[2] or 1), match[3])


def record_layout(message_fields: Sequence[Field]) -> struct.Struct:
    """Return the layout of a data message: size, type, subscription, then the fields."""
    codes = "".join(f"{field.length}{_CODES[field.kind]}" for field in message_fields)
    return struct.Struct("<HBH" + codes)


def header(time_us: int) -> bytes:
    """Encode the header of a file that begins at `time_us` since boot, with the flag bits."""
    flags = bytes([_DEFAULT_PARAMETERS]) + bytes(7) + bytes(8) + bytes(24)
    return MAGIC + struct.pack("<BQ", FILE_VERSION, time_us) + _message(b"B", flags)


def format_definition(name: str, message_fields: Sequence[Field]) -> bytes:
    """Encode the format of the data messages of one topic."""
    declarations = "".join(f"{field.declaration};" for field in message_fields)
    return _message(b"F", f"{name}:{declarations}".encode())


def information(key: str, value: str | int) -> bytes:
    """Encode an information message: a text, or a number that fits 32 bits."""
    return _message(b"I", _key_and_value(key, value))


def parameter(name: str, value: ParameterValue) -> bytes:
    """Encode the value of a parameter: int for INT32, float for REAL32."""
    return _message(b"P", _parameter(name, value))


def parameter_default(name: str, value: ParameterValue) -> bytes:
    """Encode the default of a parameter; written for parameters that have been set."""
    return _message(b"Q", bytes([_SYSTEM_DEFAULT]) + _parameter(name, value))


def subscription(identifier: int, name: str) -> bytes:
    """Encode a subscription, which binds the data messages of one identifier to a format."""
    return _message(b"A", struct.pack("<BH", 0, identifier) + name.encode())


def text(severity: int, time_us: int, content: str) -> bytes:
    """Encode a logged text; the severity is syslog's, 0 emergency to 7 debug."""
    level = str(min(max(severity, 0), 7)).encode()
    encoded = content.encode("utf-8", "replace")[:TEXT_MAX]
    return _message(b"L", level + struct.pack("<Q", time_us) + encoded)


def synchronisation() -> bytes:
    """Encode the bytes at which a reader resumes after a damaged section."""
    return _message(b"S", SYNC_BYTES)


def _message(kind: bytes, payload: bytes) -> bytes:
    return struct.pack("<Hc", len(payload), kind) + payload


def _key_and_value(key: str, value: str | int) -> bytes:
    if isinstance(value, str):
        encoded = value.encode()
        return _key(f"char[{len(encoded)}] {key}") + encoded
    kind, code = ("int32_t", "<i") if value < 0 else ("uint32_t", "<I")
    return _key(f"{kind} {key}") + struct.pack(code, value)


def _parameter(name: str, value: ParameterValue) -> bytes:
    if isinstance(value, int):
        return _key(f"int32_t {name}") + struct.pack("<i", value)
    return _key(f"float {name}") + struct.pack("<f", value)


def _key(spelling: str) -> bytes:
    encoded = spelling.encode()
    return bytes([len(encoded)]) + encoded


class LoggedMessage(NamedTuple):
    """One ULog topic with PX4's message and field names and units.

    `values` converts a message of this flight stack. NaN means unknown, as in PX4.
    """

    name: str
    fields: tuple[Field, ...]
    values: Callable[[Any], Values]


def declare(name: str, declaration: str, values: Callable[[Any], Values]) -> LoggedMessage:
    """Return a message whose first field is the time stamp [us since boot]."""
    return LoggedMessage(name, fields("uint64_t timestamp; " + declaration), values)
