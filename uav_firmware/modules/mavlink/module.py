"""The MAVLink module: datagrams in, topics out; topics in, datagrams out."""

from collections.abc import Callable, Sequence
from typing import Final

from uav_firmware.cal.link import Link
from uav_firmware.modules.mavlink.builders.context import BatteryThresholds, Context
from uav_firmware.modules.mavlink.changes import ChangeDetector
from uav_firmware.modules.mavlink.dialect import mavlink, parse
from uav_firmware.modules.mavlink.peers import Peer, PeerTable
from uav_firmware.modules.mavlink.streams import DEFAULT_INTERVALS_US
from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.modules.mavlink.transmitter import Transmitter
from uav_firmware.msg.mission import MissionItem, MissionRejection
from uav_firmware.parameters import Registry

MissionCheck = Callable[[Sequence[MissionItem]], MissionRejection | None]
"""Judges whether a whole mission can be flown."""


class MavlinkModule:
    """Speaks MAVLink for component 1 of the vehicle.

    `update` is called in every control step. `serve` may be called in between, whenever a
    datagram has arrived, so that a transfer is not slowed to one message per step.
    """

    def __init__(
        self,
        *,
        link: Link,
        system_id: int,
        registry: Registry,
        topics: MavlinkTopics,
        check_mission: MissionCheck,
        peers: Sequence[Peer],
        boot_time_utc_us: int = 0,
        save_parameters: Callable[[], None] = lambda: None,
    ) -> None:
        """Open channels to the configured peers.

        Args:
            link: Carries the datagrams.
            system_id: MAVLink system id of the vehicle, 1 to 250.
            registry: The vehicle's parameters.
            topics: Connections to the bus.
            check_mission: Judges an uploaded mission before it is accepted.
            peers: Who is sent telemetry from the start.
            boot_time_utc_us: World time at vehicle time zero [us since 1970]; 0 unknown.
            save_parameters: Called after a parameter was changed by a peer; may raise OSError.
        """
        self._link = link
        self._system_id = system_id
        self._registry = registry
        self._topics = topics
        self._boot_time_utc_us = boot_time_utc_us
        self._peers = PeerTable(peers, DEFAULT_INTERVALS_US)
        self._transmitter = Transmitter(link, system_id, self._peers)
        self._changes = ChangeDetector(topics)
        self._check_mission = check_mission
        self._save_parameters = save_parameters

    def update(self, now_us: int) -> None:
        """Do everything that is due at `now_us` [us since boot]."""
        self.serve(now_us)
        context = self._context(now_us)
        self._transmitter.broadcast(self._changes.take(), context)
        self._transmitter.stream(context)

    def serve(self, now_us: int) -> None:
        """Answer the datagrams that have arrived."""
        for datagram, address in self._link.receive():
            parsed = parse(datagram)
            for message in parsed.messages:
                if message.get_type() == "HEARTBEAT":
                    self._peers.learn(address, now_us)

    def _context(self, now_us: int) -> Context:
        return Context(
            topics=self._topics,
            now_us=now_us,
            boot_time_utc_us=self._boot_time_utc_us,
            system_id=self._system_id,
            battery_thresholds=BatteryThresholds(low=0.15, critical=0.07, emergency=0.05),
            vibration_frd=(0.0, 0.0, 0.0),
        )
