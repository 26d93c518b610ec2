"""The parameters of a scripted vehicle: its settings, its battery, what it wants of a station."""

import struct
from collections.abc import Callable

from tests.support.vehicle_script import Script
from tests.support.vehicle_wire import Message, mavlink

WHOLE = frozenset({"COM_DL_LOSS_T"})
"""Settings that PX4 keeps as whole numbers, and sends by their bits."""
WHOLE_AS_FLOATS = {
    "BATT_CAPACITY": mavlink.MAV_PARAM_TYPE_INT32,
    "MIS_RESTART": mavlink.MAV_PARAM_TYPE_INT8,
}
"""The same of ArduPilot, which sends them as floats."""


class ScriptedParameters:
    """The parameter protocol's vehicle end; `send` sends."""

    def __init__(self, script: Script, send: Callable[[Message], None]) -> None:
        self.settings = dict(script.settings)
        self.written: list[tuple[str, float]] = []  # As they were set
        self._send = send

    def read(self, name: str, script: Script) -> None:
        """Send a parameter: a setting, the battery's size, the action on data link loss."""
        value = self.settings.get(name)
        if name.startswith("BAT"):
            value = script.battery_capacity_mah
        elif name == "NAV_DLL_ACT" and script.link_loss_action is not None:
            self._send_integer(name, script.link_loss_action)
        if value is not None and name in WHOLE:
            self._send_integer(name, int(value))
        elif value is not None:
            kind = WHOLE_AS_FLOATS.get(name, mavlink.MAV_PARAM_TYPE_REAL32)
            self._send(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 0))

    def _send_integer(self, name: str, value: int) -> None:
        """Send a whole number as PX4 does, by its bits."""
        (bits,) = struct.unpack("<f", struct.pack("<i", value))
        kind = mavlink.MAV_PARAM_TYPE_INT32
        self._send(mavlink.MAVLink_param_value_message(name.encode(), bits, kind, 1, 0))

    def set(self, name: str, value: float) -> None:
        """Set a parameter that is a setting."""
        if name in self.settings:
            if name in WHOLE:
                (value,) = struct.unpack("<i", struct.pack("<f", value))
            self.settings[name] = value
            self.written.append((name, value))
