"""Parameters that state what the vehicle is: each has one value and is read only.

QGroundControl's setup pages read them by PX4's names. It shows a vehicle whose airframe, sensors or
source of sticks it does not find as not set up, and reports every other name that its pages read
and the vehicle lacks as "Parameters are missing from firmware"
(FactPanelController::getParameterFact, in the summaries and pages of AutoPilotPlugins/PX4).
A compass that is not there is shown as ready without its id (SensorsComponentSummary.qml).
"""

from collections.abc import Iterator, Mapping
from typing import Final

from uav_firmware.parameters import Declaration, ParameterValue

_DJI_F450: Final = 4011
"""PX4's airframe number."""
_SIMULATED_IMU: Final = 1310988
_SIMULATED_MAG: Final = 197388
"""PX4's ids of simulated sensors, which need no calibration."""
_NEXT_INSTANCE: Final = 0x100
"""Difference between the ids of two instances of a sensor: PX4 has the address in the 2nd byte."""
_MOST_COMPASSES: Final = 3
"""Number of compasses that QGroundControl reads the ids of."""
_STICKS_FROM_MAVLINK: Final = 1

_INPUTS: Final[Mapping[str, str]] = {
    "RC_MAP_ROLL": "roll",
    "RC_MAP_PITCH": "pitch",
    "RC_MAP_YAW": "yaw",
    "RC_MAP_THROTTLE": "throttle",
    "RC_MAP_FLAPS": "flaps",
    "RC_MAP_AUX1": "the first auxiliary output",
    "RC_MAP_AUX2": "the second auxiliary output",
    "RC_MAP_FLTMODE": "the choice of mode",
    "RC_MAP_ARM_SW": "the switch that arms",
    "RC_MAP_GEAR_SW": "the switch of the landing gear",
    "RC_MAP_KILL_SW": "the switch that stops the motors",
    "RC_MAP_LOITER_SW": "the switch to hold mode",
    "RC_MAP_OFFB_SW": "the switch to offboard mode",
    "RC_MAP_RETURN_SW": "the switch to return mode",
}
"""What PX4 assigns to channels of a radio receiver, which the vehicle does not have."""
_MODE_SLOTS: Final = 6


def vehicle_facts(system_id: int, compasses: int) -> tuple[Declaration, ...]:
    """All facts about a vehicle with this system id and number of compasses."""
    return (
        _fact("SYS_AUTOSTART", _DJI_F450, "Airframe number of PX4"),
        _fact("SYS_AUTOCONFIG", 0, "Values to load for the airframe", {0: "keep parameters"}),
        _fact("MAV_SYS_ID", system_id, "System id, set at the start of the program"),
        _fact("CAL_GYRO0_ID", _SIMULATED_IMU, "Id of the calibrated gyroscope"),
        _fact("CAL_ACC0_ID", _SIMULATED_IMU, "Id of the calibrated accelerometer"),
        *_compasses(compasses),
        _fact("SENS_BOARD_ROT", 0, "Rotation of the autopilot in the vehicle", {0: "none"}),
        _fact("SENS_DPRES_OFF", 0.0, "Offset of an airspeed sensor, which is not there", unit="Pa"),
        _fact("COM_RC_IN_MODE", _STICKS_FROM_MAVLINK, "Source of sticks", {1: "MANUAL_CONTROL"}),
        *(
            _fact(name, 0, f"Channel of a radio receiver for {use}", {0: "unassigned"})
            for name, use in _INPUTS.items()
        ),
        *(
            _fact(f"COM_FLTMODE{slot}", -1, f"Mode of position {slot} of a switch", {-1: "none"})
            for slot in range(1, _MODE_SLOTS + 1)
        ),
        _fact("BAT1_SOURCE", 0, "Source of the battery's measurements", {0: "power module"}),
        _fact(
            "BAT1_V_LOAD_DROP", 0.0, "Drop of a cell under load; BAT1_R_INTERNAL is used", unit="V"
        ),
        _fact("CP_DIST", -1.0, "Distance kept from obstacles; -1 as none are sensed", unit="m"),
        _fact("COM_OBS_AVOID", 0, "Avoidance of obstacles", {0: "none are sensed"}),
    )  # fmt: skip


def _compasses(fitted: int) -> Iterator[Declaration]:
    for instance in range(_MOST_COMPASSES):
        number = _SIMULATED_MAG + instance * _NEXT_INSTANCE if instance < fitted else 0
        yield _fact(f"CAL_MAG{instance}_ID", number, "Id of the calibrated magnetometer; 0 none")
        yield _fact(
            f"CAL_MAG{instance}_ROT", -1, "Rotation of a magnetometer", {-1: "in the autopilot"}
        )


def _fact(
    name: str,
    value: ParameterValue,
    short: str,
    values: Mapping[int, str] | None = None,
    *,
    unit: str = "1",
) -> Declaration:
    return Declaration(
        name=name,
        default=value,
        unit=unit,
        minimum=value,
        maximum=value,
        short=f"{short}; read only",
        is_integer=isinstance(value, int),
        values=values or {},
    )
