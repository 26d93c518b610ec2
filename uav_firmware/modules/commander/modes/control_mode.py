"""Which module leads in a mode, and the outermost loop that is closed: one table. Pure."""

from collections.abc import Mapping
from typing import Final

from uav_firmware.msg.control_mode import ControlLevel, ControlSource, OffboardSetpoint
from uav_firmware.msg.setpoints import VehicleAttitudeSetpoint, VehicleRatesSetpoint
from uav_firmware.msg.status import NavigationState

_PILOTED: Final[Mapping[NavigationState, ControlLevel]] = {
    NavigationState.MANUAL: ControlLevel.ATTITUDE,
    NavigationState.STAB: ControlLevel.ATTITUDE,
    NavigationState.ACRO: ControlLevel.RATES,
    NavigationState.ALTCTL: ControlLevel.POSITION,
    NavigationState.POSCTL: ControlLevel.POSITION,
}


def level_of(setpoint: OffboardSetpoint | None) -> ControlLevel:
    """The loop that a streamed set-point is for."""
    if isinstance(setpoint, VehicleAttitudeSetpoint):
        return ControlLevel.ATTITUDE
    if isinstance(setpoint, VehicleRatesSetpoint):
        return ControlLevel.RATES
    return ControlLevel.POSITION


def control_of(
    mode: NavigationState, setpoint: OffboardSetpoint | None
) -> tuple[ControlSource, ControlLevel]:
    """Who leads in a mode, and how."""
    if mode in _PILOTED:
        return ControlSource.MANUAL, _PILOTED[mode]
    if mode is NavigationState.OFFBOARD:
        return ControlSource.OFFBOARD, level_of(setpoint)
    return ControlSource.NAVIGATOR, ControlLevel.POSITION
