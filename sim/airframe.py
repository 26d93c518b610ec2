"""The bundled F450 with places where forces from outside JSBSim's own models can act.

JSBSim takes such forces only from the airframe's own file, so the installed airframe is copied
to a passing folder with one element more. Nothing in it is changed.
"""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

AIRFRAME: Final = "F450"

_END: Final = "</fdm_config>"
_OUTSIDE_FORCES: Final = """
    <external_reactions>
        <moment name="rotor-drag" frame="BODY">
            <direction> <x>0</x> <y>0</y> <z>1</z> </direction>
        </moment>
        <force name="ground-effect" frame="BODY">
            <location unit="M"> <x>0</x> <y>0</y> <z>0</z> </location>
            <direction> <x>0</x> <y>0</y> <z>-1</z> </direction>
        </force>
    </external_reactions>
"""


class AirframeFileError(OSError):
    """The installed airframe is not what it should be."""


@contextmanager
def extended_airframe(bundled: Path) -> Iterator[Path]:
    """A folder of airframes that holds the extended F450, as long as the context lasts.

    `bundled` is the folder of the airframes that came with JSBSim.

    Raises:
        OSError: if they cannot be read, or there is no room for a copy.
        AirframeFileError: if the airframe's file does not end as it should.
    """
    with tempfile.TemporaryDirectory(prefix="airframe-") as folder:
        copy = Path(folder) / AIRFRAME
        shutil.copytree(bundled / AIRFRAME, copy)
        description = copy / f"{AIRFRAME}.xml"
        text = description.read_text(encoding="utf-8")
        if text.count(_END) != 1:
            raise AirframeFileError(f"{bundled / AIRFRAME}: there is not one {_END}")
        description.chmod(0o600)
        description.write_text(text.replace(_END, _OUTSIDE_FORCES + _END), encoding="utf-8")
        yield Path(folder)
