"""The broker's log download at one end of a bad link, the vehicle's log server at the other.

Time is simulated.
"""

import random
from pathlib import Path
from typing import Final

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.log_download import LogDownload, LogEntry, LogList
from tests.support.file_air import module_at
from tests.support.lossy_link import VEHICLE_ADDRESS, Conditions, LossyLink
from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM

STEP_S: Final = 0.004
PATIENCE_S: Final = 600.0
PART_BYTES: Final = 32 * 1024
"""Of the tests of flight logs, an eighth of what the broker sends at once."""
ROUTE: Final = Route(own_system=254, own_component=191, target_system=SYSTEM, target_component=1)


class LogAir:
    """A MAVLink module on one end of the link, a client of its logs on the other."""

    def __init__(self, folder: Path, conditions: Conditions, seed: int = 1) -> None:
        self.folder = folder
        self.link = LossyLink(conditions, conditions, seed=seed)
        self.now_s = 0.0
        self.requests = 0
        for name in ("log", "image"):
            (folder / name).mkdir(exist_ok=True)
        self._module = module_at(self.link, folder)
        self._encoder = Encoder(254, 191)
        self._decoder = Decoder()

    def reboot(self) -> None:
        """Forget everything but the card."""
        self._module = module_at(self.link, self.folder)

    def write_log(self, time: str, size: int, seed: int = 1) -> bytes:
        """Write a log of 2026-03-01; gives its contents."""
        contents = random.Random(seed).randbytes(size)
        path = self.folder / "log" / "2026-03-01" / f"{time}.ulg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(contents)
        return contents

    def list_logs(self) -> tuple[LogEntry, ...]:
        """List the logs of the vehicle."""
        logs = LogList(ROUTE, RoundTrip())
        self.send(logs.start(self.now_s))
        end = self.now_s + PATIENCE_S
        while logs.entries is None:
            assert self.now_s < end
            for message in self.step():
                logs.receive(message, self.now_s)
            self.send(logs.tick(self.now_s))
        return logs.entries

    def fetch(
        self,
        download: LogDownload,
        *,
        reboot_after_s: float = PATIENCE_S,
        until_s: float = PATIENCE_S,
    ) -> bytes:
        """Receive what is left of a log, or what comes until a time."""
        received = b""
        self.send(download.tick(self.now_s))
        reboot_at = self.now_s + reboot_after_s
        while self.now_s < until_s and download.failure is None:
            if (part := download.part) is not None:
                received += part.data
                if part.is_last:
                    self.send([mavlink.MAVLink_log_request_end_message(1, 1)])
                    return received
                self.send(download.proceed(self.now_s))
            if self.now_s >= reboot_at:
                reboot_at = until_s
                self.reboot()
            for message in self.step():
                self.send(download.receive(message, self.now_s))
            self.send(download.tick(self.now_s))
        return received

    def step(self, step_s: float = STEP_S) -> list[Message]:
        """Let some time pass; gives what has arrived."""
        self.now_s += step_s
        now_us = round(self.now_s * 1e6)
        if now_us % 500_000 < step_s * 1e6:
            self.send([mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)])
        self.link.advance(now_us)
        self._module.serve(now_us)
        self._module.update(now_us)
        datagrams = self.link.ground.receive()
        return [one for datagram, _ in datagrams for one in self._decoder.decode(datagram)]

    def send(self, messages: list[Message]) -> None:
        """Send to the vehicle."""
        for message in messages:
            self.requests += message.get_type() == "LOG_REQUEST_DATA"
            self.link.ground.send(self._encoder.encode(message), VEHICLE_ADDRESS)
