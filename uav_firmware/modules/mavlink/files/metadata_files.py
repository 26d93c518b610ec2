"""`/etc/extras`: component metadata for ground stations, with PX4's names.

The general file lists the others with their checksums. One file describes the parameters; it is
compressed for slow radio links. Layout: MAVLink component metadata service, version 1 of the
general and parameter schemas.
"""

import errno
import json
import lzma
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from uav_firmware.cal.files import Entry, OpenFile, OpenMode, Place
from uav_firmware.modules.mavlink.commands.commands import Answer, Command, denied
from uav_firmware.modules.mavlink.files.client import checksum_of
from uav_firmware.modules.mavlink.files.tree import GeneratedFile, ReadOnlyStore, refusal
from uav_firmware.modules.mavlink.wire.addressing import Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import ComponentMetadata
from uav_firmware.parameters import Declaration, Registry

FOLDER: Final[Place] = ("etc", "extras")
GENERAL: Final = "component_general.json"
PARAMETERS: Final = "parameters.json.xz"
_PARAMETER_TYPE: Final = 1  # COMP_METADATA_TYPE
_VERSION: Final = 1
_USUAL_DECIMAL_PLACES: Final = 3
_DIGITS_SHOWN: Final = 3
_NO_UNITS: Final = frozenset({"", "-", "1"})
_TARGETS: Final = {0.0: False, 1.0: False, 2.0: True}  # Whether the answer is for all peers


def address_of(name: str) -> str:
    """URI of a file."""
    return "mftp:///" + "/".join((*FOLDER, name))


class MetadataFiles(ReadOnlyStore):
    """Implements `uav_firmware.cal.files.FileStore`; the files are generated at first use.

    All parameters are registered before.
    """

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._files: Mapping[str, bytes] | None = None

    @property
    def files(self) -> Mapping[str, bytes]:
        """Contents by name, sorted."""
        if self._files is None:
            parameters = lzma.compress(_parameters(self._registry), preset=1)
            self._files = {GENERAL: _general(parameters), PARAMETERS: parameters}
        return self._files

    @property
    def general_checksum(self) -> int:
        """Checksum of the general file."""
        return checksum_of(self.files[GENERAL])

    def entries(self, place: Place) -> Sequence[Entry]:
        """The files."""
        if place:
            raise refusal(errno.ENOENT)
        return [
            Entry(name, is_folder=False, size=len(contents), modified_s=0)
            for name, contents in self.files.items()
        ]

    def open(self, place: Place, mode: OpenMode) -> OpenFile:
        """Open one of the files."""
        contents = self.files.get("/".join(place))
        if contents is None:
            raise refusal(errno.ENOENT if mode is OpenMode.READ else errno.EACCES)
        if mode is not OpenMode.READ:
            raise refusal(errno.EACCES)
        return GeneratedFile(contents)


def _general(parameters: bytes) -> bytes:
    described = {
        "type": _PARAMETER_TYPE,
        "uri": address_of(PARAMETERS),
        "fileCrc": checksum_of(parameters),
    }
    return _as_json({"version": _VERSION, "metadataTypes": [described]})


def _parameters(registry: Registry) -> bytes:
    declarations = [registry.declaration(name) for name in registry.names()]
    return _as_json({"version": _VERSION, "parameters": [_parameter(d) for d in declarations]})


def _parameter(declaration: Declaration) -> dict[str, Any]:
    described: dict[str, Any] = {
        "name": declaration.name,
        "type": "Int32" if declaration.is_integer else "Float",
        "shortDesc": declaration.short,
        "group": declaration.name.split("_")[0],
        "default": declaration.default,
    }
    if declaration.unit not in _NO_UNITS:
        described["units"] = declaration.unit
    if math.isfinite(declaration.minimum):
        described["min"] = declaration.minimum
    if math.isfinite(declaration.maximum):
        described["max"] = declaration.maximum
    if declaration.values:
        described["values"] = _listed("value", declaration.values)
    if declaration.bits:
        described["bitmask"] = _listed("index", declaration.bits)
    if (places := _decimal_places(declaration)) > _USUAL_DECIMAL_PLACES:
        described["decimalPlaces"] = places
    if declaration.is_volatile:
        described["volatile"] = True
    if declaration.read_at_start:
        described["rebootRequired"] = True
    return described


def _listed(key: str, meanings: Mapping[int, str]) -> list[dict[str, Any]]:
    return [{key: number, "description": text} for number, text in meanings.items()]


def _decimal_places(declaration: Declaration) -> int:
    """Number of decimal places that show three digits of a value like the default.

    QGroundControl shows a value with three decimal places where none are declared
    (`FactMetaData::decimalPlaces`): a gain of 0.0004 is then 0.000, and is stored so when the
    field is left.
    """
    magnitude = abs(declaration.default) or abs(declaration.maximum)
    if declaration.is_integer or not 0.0 < magnitude < math.inf:
        return 0
    return _DIGITS_SHOWN - 1 - math.floor(math.log10(magnitude))


def _as_json(contents: Mapping[str, Any]) -> bytes:
    return json.dumps(contents, separators=(",", ":"), allow_nan=False).encode()


class MetadataRequest:
    """Answers REQUEST_MESSAGE for COMPONENT_METADATA."""

    def __init__(self, general_checksum: Callable[[], int]) -> None:
        """`general_checksum` returns the checksum of the general file."""
        self._general_checksum = general_checksum

    def answer(self, command: Command, _sender: Sender, now_us: int) -> Answer | None:
        """Answer the request; None for any other command."""
        is_request = command.number == mavlink.MAV_CMD_REQUEST_MESSAGE
        if not is_request or command.parameter(1) != ComponentMetadata.id:
            return None
        target = command.parameter(7)
        to_all = _TARGETS.get(0.0 if math.isnan(target) else target)
        if to_all is None:
            return denied(f"parameter 7 is {target:g}, no response target")
        message = ComponentMetadata(
            time_boot_ms=now_us // 1000 & 0xFFFFFFFF,
            file_crc=self._general_checksum(),
            uri=address_of(GENERAL).encode("ascii"),
        )
        return Answer(mavlink.MAV_RESULT_ACCEPTED, (message,), to_all)
