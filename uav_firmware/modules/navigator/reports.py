"""What the navigator tells the others, besides the set-point."""

from typing import NamedTuple

from uav_firmware.bus import Queue, Topic
from uav_firmware.modules.navigator.flight import Flight
from uav_firmware.msg.guidance import OrbitStatus, RegionOfInterest
from uav_firmware.msg.mission import MissionItem, MissionProgress, NavigatorStatus
from uav_firmware.msg.payload import PayloadOrder
from uav_firmware.msg.status import StatusText, VehicleCommand


class ReportTopics(NamedTuple):
    """Where reports go."""

    mission_progress: Topic[MissionProgress]
    navigator_status: Topic[NavigatorStatus]
    orbit_status: Topic[OrbitStatus]
    status_text: Queue[StatusText]
    vehicle_command: Queue[VehicleCommand]
    payload_order: Queue[PayloadOrder]
    region_of_interest: Topic[RegionOfInterest]


class Reporter:
    """Publishes what has changed."""

    def __init__(self, topics: ReportTopics) -> None:
        self._topics = topics

    def report_flight(self, flight: Flight) -> None:
        """Texts, orders to others and the circle that a step of flight has left."""
        for severity, text in flight.texts:
            self._topics.status_text.publish(StatusText(flight.now_us, severity, text))
        flight.texts.clear()
        for item in flight.home_orders:
            self._topics.vehicle_command.publish(_own_command(item, flight.now_us))
        flight.home_orders.clear()
        for item in flight.payload_orders:
            self._topics.payload_order.publish(_own_command(item, flight.now_us))
        flight.payload_orders.clear()
        for region in flight.regions:
            self._topics.region_of_interest.publish(region)
        flight.regions.clear()
        status, old = flight.orbit_status, self._topics.orbit_status.value
        if status is not None:
            self._topics.orbit_status.publish(status)
        elif old is not None and old.active:
            self._topics.orbit_status.publish(old._replace(time_us=flight.now_us, active=False))

    def report_progress(self, progress: MissionProgress) -> None:
        """Progress of the mission, on change."""
        old = self._topics.mission_progress.value
        if old is None or progress[1:] != old[1:]:
            self._topics.mission_progress.publish(progress)

    def report_status(self, status: NavigatorStatus) -> None:
        """State of the mode, on change."""
        old = self._topics.navigator_status.value
        if old is None or status[1:] != old[1:]:
            self._topics.navigator_status.publish(status)


def _own_command(item: MissionItem, now_us: int) -> VehicleCommand:
    """An item as the vehicle's own command; nobody waits for its answer."""
    return VehicleCommand(now_us, item.command, *item[5:12], item.frame, 0, 0, 0)
