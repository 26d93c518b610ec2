"""Vehicle states for unit tests."""

from uav_firmware.msg.status import NavigationState, VehicleStatus


def vehicle_status(
    *,
    armed: bool = False,
    navigation_state: NavigationState = NavigationState.AUTO_LOITER,
    ready: bool = True,
) -> VehicleStatus:
    """A healthy vehicle on the ground, unless a test sets other values."""
    return VehicleStatus(
        time_us=0,
        armed=armed,
        navigation_state=navigation_state,
        failsafe=False,
        preflight_checks_pass=ready,
        armed_since_us=0,
        sensors_present=0,
        sensors_enabled=0,
        sensors_health=0,
    )
