"""What the navigator publishes besides the set-point."""

from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.mission import MissionItem, MissionProgress, NavigatorStatus
from uav_firmware.msg.status import StatusText, VehicleCommand
from uav_firmware.topics import Topics


class Reporter:
    """Publishes progress, status and commands of the navigator on change."""

    def __init__(self, topics: Topics) -> None:
        self._topics = topics

    def report_flight(self, flight: Flight) -> None:
        """Publish the texts, commands and orbit status of this step."""
        for severity, text in flight.texts:
            self._topics.status_text.publish(StatusText(flight.now_us, severity, text))
        flight.texts.clear()
        for item in flight.home_commands:
            self._topics.vehicle_command.publish(_own_command(item, flight.now_us))
        flight.home_commands.clear()
        for item in flight.payload_commands:
            self._topics.payload_order.publish(_own_command(item, flight.now_us))
        flight.payload_commands.clear()
        for region in flight.regions:
            self._topics.region_of_interest.publish(region)
        flight.regions.clear()
        status, old = flight.orbit_status, self._topics.orbit_status.value
        if status is not None:
            self._topics.orbit_status.publish(status)
        elif old is not None and old.active:
            self._topics.orbit_status.publish(old._replace(time_us=flight.now_us, active=False))

    def report_progress(self, progress: MissionProgress) -> None:
        """Publish the progress of the mission on change."""
        old = self._topics.mission_progress.value
        if old is None or progress[1:] != old[1:]:
            self._topics.mission_progress.publish(progress)

    def report_status(self, status: NavigatorStatus) -> None:
        """Publish the state of the mode on change."""
        old = self._topics.navigator_status.value
        if old is None or status[1:] != old[1:]:
            self._topics.navigator_status.publish(status)


def _own_command(item: MissionItem, now_us: int) -> VehicleCommand:
    """An item as a command of the vehicle itself, which needs no acknowledgement."""
    return VehicleCommand(now_us, item.command, *item[5:12], item.frame, 0, 0, 0)
