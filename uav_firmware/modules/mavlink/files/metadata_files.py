"""`/etc/extras`: what the parameters mean, for ground stations, as PX4 serves it.

A general file names the others with their checksums; the parameters are described in one file,
compressed because a radio has to carry it. Layout: MAVLink component metadata service, versions
1 of its general and parameter schemas.
"""

import errno
import json
import lzma
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from uav_firmware.cal.files import Entry, OpenFile, OpenMode, Place
from uav_firmware.modules.mavlink.files.checksum import checksum_of
from uav_firmware.modules.mavlink.files.generated import FixedStore, GeneratedFile, refusal
from uav_firmware.parameters import Declaration, Registry

FOLDER: Final[Place] = ("etc", "extras")
GENERAL: Final = "component_general.json"
PARAMETERS: Final = "parameters.json.xz"
_PARAMETER_TYPE: Final = 1  # COMP_METADATA_TYPE
_VERSION: Final = 1
_NO_UNITS: Final = frozenset({"", "-", "1"})


def address_of(name: str) -> str:
    """Where a client finds one of the files."""
    return "mftp:///" + "/".join((*FOLDER, name))


class MetadataFiles(FixedStore):
    """Implements `uav_firmware.cal.files.FileStore`; the files are made when first wanted.

    Parameters are registered while the vehicle is put together, and none after.
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
    if declaration.is_volatile:
        described["volatile"] = True
    return described


def _as_json(contents: Mapping[str, Any]) -> bytes:
    return json.dumps(contents, separators=(",", ":"), allow_nan=False).encode()
