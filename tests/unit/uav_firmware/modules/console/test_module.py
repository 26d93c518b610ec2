from tests.support.vehicle_status import vehicle_status
from uav_firmware.bus import Fork, Topic
from uav_firmware.modules.console.module import ConsoleModule
from uav_firmware.msg.mission import MissionProgress
from uav_firmware.msg.status import (
    LandDetected,
    LandedState,
    NavigationState,
    StatusText,
    VehicleStatus,
)


class Vehicle:
    """The console with its topics and its lines."""

    def __init__(self) -> None:
        self.texts: Fork[StatusText] = Fork()
        self.status: Topic[VehicleStatus] = Topic()
        self.land: Topic[LandDetected] = Topic()
        self.progress: Topic[MissionProgress] = Topic()
        self._lines: list[tuple[int, str]] = []
        self._module = ConsoleModule(
            lambda time_us, text: self._lines.append((time_us, text)),
            status_text=self.texts.second,
            vehicle_status=self.status,
            land_detected=self.land,
            mission_progress=self.progress,
            time_us=lambda: 7,
        )

    def lines(self) -> list[str]:
        self._lines.clear()
        self._module.update()
        return [text for _, text in self._lines]


def test_arming_and_mode_are_logged_once() -> None:
    vehicle = Vehicle()
    vehicle.status.publish(vehicle_status(ready=False))
    assert vehicle.lines() == ["mode AUTO_LOITER"]
    vehicle.status.publish(
        vehicle_status(armed=True, navigation_state=NavigationState.AUTO_MISSION)
    )
    assert vehicle.lines() == ["armed", "mode AUTO_MISSION", "ready to arm"]
    assert vehicle.lines() == []
    vehicle.status.publish(vehicle_status(navigation_state=NavigationState.AUTO_MISSION))
    assert vehicle.lines() == ["disarmed"]


def test_landed_states_and_items_are_logged_on_change() -> None:
    vehicle = Vehicle()
    vehicle.land.publish(
        LandDetected(
            0,
            landed=True,
            ground_contact=True,
            landed_state=LandedState.ON_GROUND,
            has_low_throttle=True,
        )
    )
    vehicle.progress.publish(MissionProgress(0, 5, 0, 3, -1, 0, 2))
    assert vehicle.lines() == ["mission of 3 items"]
    vehicle.land.publish(
        LandDetected(
            0,
            landed=False,
            ground_contact=False,
            landed_state=LandedState.TAKEOFF,
            has_low_throttle=False,
        )
    )
    vehicle.progress.publish(MissionProgress(0, 5, 1, 3, 0, 1, 3))
    assert vehicle.lines() == ["landed state TAKEOFF", "mission item 0 reached"]


def test_status_texts_reach_console_and_link() -> None:
    vehicle = Vehicle()
    vehicle.texts.publish(StatusText(3, 4, "Battery low"))
    assert vehicle.lines() == ["Battery low"]
    assert [text.text for text in vehicle.texts.drain()] == ["Battery low"]
