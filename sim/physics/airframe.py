"""The bundled F450 as this simulation flies it: forces from outside added, idle parts left out.

JSBSim takes forces from outside its own models only from the airframe's own file, so the
installed airframe is copied to a passing folder and the copy is edited; the installed files
stay as they are. The copy has one element more, external reactions for rotor drag and ground
effect (`sim/physics/rotor_effects.py`), and five elements are put in short:

* The bundled flight controller and sensors, some fifty components, run in every physics step for
  nothing: the motors are driven through the external inputs beside them. What stays of them is
  the path from those inputs to the ESCs.
* Of the aerodynamics all coefficients are zero but that of drag, which is one: drag is the
  dynamic pressure times the reference area, opposed to the motion.

The shortening alone changes nothing: with and without it the vehicle flies the same to the last
bit, and a physics step costs three fifths. The external reactions do change the flight.
"""

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from sim.physics.rotor_effects import ROTOR_ABOVE_CENTRE_M

AIRFRAME: Final = "F450"

_END: Final = "</fdm_config>"
_MOTORS: Final = ("FR", "AL", "FL", "AR")
_OUTSIDE_FORCES: Final = f"""
    <external_reactions>
        <force name="rotor-drag-forward" frame="BODY">
            <location unit="M"> <x>0</x> <y>0</y> <z>{ROTOR_ABOVE_CENTRE_M}</z> </location>
            <direction> <x>1</x> <y>0</y> <z>0</z> </direction>
        </force>
        <force name="rotor-drag-right" frame="BODY">
            <location unit="M"> <x>0</x> <y>0</y> <z>{ROTOR_ABOVE_CENTRE_M}</z> </location>
            <direction> <x>0</x> <y>1</y> <z>0</z> </direction>
        </force>
        <moment name="rotor-drag" frame="BODY">
            <direction> <x>0</x> <y>0</y> <z>1</z> </direction>
        </moment>
        <force name="ground-effect" frame="BODY">
            <location unit="M"> <x>0</x> <y>0</y> <z>0</z> </location>
            <direction> <x>0</x> <y>0</y> <z>-1</z> </direction>
        </force>
    </external_reactions>
"""

_FLIGHT_CONTROL: Final = """<flight_control name="external inputs">
        {inputs}
        <channel name="external inputs">
            {gains}
        </channel>
    </flight_control>""".format(
    inputs="\n        ".join(
        f'<property value="0.0">fcs/cmd{motor}_ext_nd</property>' for motor in _MOTORS
    ),
    gains="\n            ".join(
        f"""<pure_gain name="fcs/external-{motor}">
                <input>fcs/cmd{motor}_ext_nd</input>
                <gain>1.0</gain>
                <output>fcs/cmdEsc{motor}_nd</output>
            </pure_gain>"""
        for motor in _MOTORS
    ),
)
_AERODYNAMICS: Final = """<aerodynamics>
        <axis name="DRAG">
            <function name="aero/force/DRAG__CD">
                <property>aero/qbar-area</property>
            </function>
        </axis>
    </aerodynamics>"""

SHORTENED: Mapping[str, str] = {
    '<flight_control file="FlightControl.xml"/>': _FLIGHT_CONTROL,
    '<system file="SensorImu.xml"/>': "",
    '<system file="SensorBaro.xml"/>': "",
    '<system file="SensorGps.xml"/>': "",
    '<aerodynamics file="Aero.xml"/>': _AERODYNAMICS,
}
"""Elements of the airframe's file and their replacements."""


class AirframeFileError(OSError):
    """The installed airframe is not what it should be."""


@contextmanager
def extended_airframe(bundled: Path) -> Iterator[Path]:
    """A folder of airframes that holds the extended F450, as long as the context lasts.

    `bundled` is the folder of the airframes that came with JSBSim.

    Raises:
        OSError: if they cannot be read, or there is no room for a copy.
        AirframeFileError: if the airframe's file lacks an element that is replaced.
    """
    with tempfile.TemporaryDirectory(prefix="airframe-") as folder:
        copy = Path(folder) / AIRFRAME
        shutil.copytree(bundled / AIRFRAME, copy)
        description = copy / f"{AIRFRAME}.xml"
        text = description.read_text(encoding="utf-8")
        for element, short in {**SHORTENED, _END: _OUTSIDE_FORCES + _END}.items():
            if text.count(element) != 1:
                raise AirframeFileError(f"{bundled / AIRFRAME}: there is not one {element}")
            text = text.replace(element, short)
        description.chmod(0o600)
        description.write_text(text, encoding="utf-8")
        yield Path(folder)
