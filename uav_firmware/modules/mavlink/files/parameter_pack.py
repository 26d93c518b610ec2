"""ArduPilot's compact parameter file format `param.pck`.

Header: three little-endian uint16: magic, number of parameters in the file, total number of
parameters (in an upload also: length of the file). Then for each parameter, sorted by name:

    type in the low four bits (1 int8, 2 int16, 3 int32, 4 float), flags in the high ones
        (1: the default follows the value)
    low four bits: letters shared with the previous name; high four: other letters, less one
    the other letters, the value, the default

A zero in place of a type is padding.
"""

import struct
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from uav_firmware.parameters import ParameterValue

MAGIC: Final = 0x671B
MAGIC_WITH_DEFAULTS: Final = 0x671C
NAME_MAX: Final = 16
_HEADER: Final = struct.Struct("<HHH")
_INT32: Final = 3
_FLOAT: Final = 4
_TYPES: Final = {
    1: struct.Struct("<b"),
    2: struct.Struct("<h"),
    _INT32: struct.Struct("<i"),
    _FLOAT: struct.Struct("<f"),
}
_DEFAULT_FOLLOWS: Final = 1
_SHARED_MAX: Final = 15


class PackError(ValueError):
    """The bytes are not a valid pack; the text says why."""


class PackedParameter(NamedTuple):
    """One parameter."""

    name: str
    value: ParameterValue
    default: ParameterValue
    is_integer: bool


def write_pack(
    parameters: Sequence[PackedParameter], *, total: int, with_defaults: bool = False
) -> bytes:
    """Pack sorted parameters; `total` is the number of all parameters of the vehicle."""
    magic = MAGIC_WITH_DEFAULTS if with_defaults else MAGIC
    records, before = [_HEADER.pack(magic, len(parameters), total)], b""
    for parameter in parameters:
        name = parameter.name.encode("ascii")
        records.append(_record(parameter, name, before, with_defaults=with_defaults))
        before = name
    return b"".join(records)


def _record(
    parameter: PackedParameter, name: bytes, before: bytes, *, with_defaults: bool
) -> bytes:
    kind = _INT32 if parameter.is_integer else _FLOAT
    shared = _shared(before, name)
    value, default = _TYPES[kind].pack(parameter.value), _TYPES[kind].pack(parameter.default)
    differs = with_defaults and value != default
    return b"".join(
        (
            bytes((kind | (_DEFAULT_FOLLOWS << 4 if differs else 0),)),
            bytes((shared | (len(name) - shared - 1) << 4,)),
            name[shared:],
            value,
            default if differs else b"",
        )
    )


def _shared(before: bytes, name: bytes) -> int:
    """Number of letters shared with the previous name, up to the limit of the format."""
    most = min(len(before), len(name) - 1, _SHARED_MAX)
    return next((i for i in range(most) if before[i] != name[i]), max(most, 0))


def read_pack(data: bytes) -> list[tuple[str, float]]:
    """Names and values of a pack, in its order, without defaults.

    Raises:
        PackError: if the bytes are not a complete pack.
    """
    if len(data) < _HEADER.size:
        raise PackError(f"{len(data)} bytes are too few for a header")
    magic, count, _ = _HEADER.unpack_from(data)
    if magic not in {MAGIC, MAGIC_WITH_DEFAULTS}:
        raise PackError(f"magic number {magic:#06x} is not that of a pack")
    parameters = list(_records(data, with_defaults=magic == MAGIC_WITH_DEFAULTS))
    if len(parameters) != count:
        raise PackError(f"{len(parameters)} parameters where the header says {count}")
    return parameters


def _records(data: bytes, *, with_defaults: bool) -> Iterator[tuple[str, float]]:
    position, before = _HEADER.size, b""
    while position < len(data):
        if data[position] == 0:
            position += 1
            continue
        try:
            kind = _TYPES[data[position] & 0x0F]
            shared, further = data[position + 1] & 0x0F, (data[position + 1] >> 4) + 1
            name_end = position + 2 + further
            before = _name(before, shared, data[position + 2 : name_end])
            (value,) = kind.unpack_from(data, name_end)
        except (KeyError, IndexError, struct.error):
            raise PackError(f"byte {position} does not begin a parameter") from None
        yield before.decode("ascii"), value
        has_default = with_defaults and data[position] >> 4 & _DEFAULT_FOLLOWS
        position = name_end + kind.size * (2 if has_default else 1)


def _name(before: bytes, shared: int, further: bytes) -> bytes:
    """Name from the shared and the other letters."""
    name = before[:shared] + further
    if shared > len(before) or len(name) > NAME_MAX or not name.isascii():
        raise PackError(f"{name!r} is not a parameter name")
    return name
