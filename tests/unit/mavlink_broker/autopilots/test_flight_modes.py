"""Names and roles of flight modes."""

import pytest

from mavlink_broker.autopilots.families import ARDUPILOT, GENERIC, PX4, Family
from mavlink_broker.autopilots.flight_modes import ModeRole


@pytest.mark.parametrize(
    ("family", "base", "custom", "name", "role"),
    [
        (PX4, 1, 4 << 16 | 4 << 24, "AUTO.MISSION", ModeRole.MISSION),
        (PX4, 1, 4 << 16 | 3 << 24, "AUTO.LOITER", ModeRole.HOLD),
        (PX4, 1, 4 << 16 | 5 << 24, "AUTO.RTL", ModeRole.ENDING),
        (PX4, 1, 4 << 16 | 6 << 24, "AUTO.LAND", ModeRole.ENDING),
        (PX4, 1, 3 << 16, "POSCTL", ModeRole.OTHER),
        (PX4, 1, 3 << 16 | 1 << 24, "POSCTL.ORBIT", ModeRole.GUIDED),
        (PX4, 1, 99 << 16 | 7 << 24, "MODE_99.7", ModeRole.OTHER),
        (ARDUPILOT, 1, 3, "AUTO", ModeRole.MISSION),
        (ARDUPILOT, 1, 17, "BRAKE", ModeRole.PAUSED),
        (ARDUPILOT, 1, 6, "RTL", ModeRole.ENDING),
        (ARDUPILOT, 1, 0, "STABILIZE", ModeRole.OTHER),
        (ARDUPILOT, 1, 77, "MODE_77", ModeRole.OTHER),
        (GENERIC, 4, 0, "AUTO", ModeRole.MISSION),
        (GENERIC, 0, 5, "MODE_5", ModeRole.MISSION),
    ],
)
def test_a_mode_has_its_familys_name_and_role(
    family: Family, base: int, custom: int, name: str, role: ModeRole
) -> None:
    assert family.mode_name(base, custom) == name
    assert family.mode_role(name) is role
