"""The logs of an ArduPilot vehicle behind a bad link, as its sources serve them.

`AP_Logger_File.cpp`: a log is opened when the vehicle arms and stays open behind the flight; an
open log is listed with the present time, a closed one with that of its last change. Reading any log
closes the open one. For 15 s after disarming, and always with LOG_DISARMED, another is opened then.
`AP_Logger_MAVLinkLogTransfer.cpp`: logs are numbered from 1; `last_log_num` is the end of what was
requested; nothing is answered while armed, and no request while another one is being answered.
"""

import random
from dataclasses import dataclass
from typing import Final

from mavlink_broker.mavlink.codec import Decoder, Encoder
from tests.support.lossy_link import GROUND_ADDRESS, VEHICLE_ADDRESS, Conditions, LossyLink
from tests.support.vehicle_wire import Message, VehicleWire, mavlink

PERSISTS_S: Final = 15.0
PACKETS_PER_S: Final = 2000.0
ENTRIES_PER_S: Final = 200.0


@dataclass(slots=True)
class StoredLog:
    """One file."""

    contents: bytes
    changed_s: float  # [s] Since boot


class ArduPilotLogs:
    """A vehicle that serves logs, on the link of a client; time is simulated."""

    def __init__(
        self,
        conditions: Conditions,
        boot_s: float,
        *,
        logs_disarmed: bool = False,
        closes_logs: bool = False,
        file_clock_s: float = 0.0,
        dates_opening: bool = False,
    ) -> None:
        """Begin without logs; `boot_s` [s since 1970] is the present time.

        `closes_logs`: LOG_FILE_DSRMROT is 1. `file_clock_s`: how much the clock of the files is
        ahead of that of the vehicle, as it is where a simulation does not run at the pace of its
        computer. `dates_opening`: files keep the time at which they were opened, as on ChibiOS.
        """
        self.link = LossyLink(conditions, conditions, seed=1)
        self.now_s = 0.0
        self.requests = 0
        self.files: list[StoredLog] = []
        self._boot_s = boot_s
        self._logs_disarmed = logs_disarmed
        self._closes_logs = closes_logs
        self._dates_opening = dates_opening
        self._file_clock_s = file_clock_s
        self._open: StoredLog | None = None
        self._is_armed = False
        self._persists_until = 0.0
        self._listing: list[int] = []
        self._last_listed = 0
        self._sending: tuple[int, int, int] | None = None  # Number, offset, end
        self._allowance = 0.0
        self._wire = VehicleWire(1, 1)
        self._encoder, self._decoder = Encoder(254, 191), Decoder()

    def arm(self) -> None:
        """Arm; the flight is logged into the open log, or into a new one."""
        self._is_armed = True
        if self._open is None:
            self._begin_log()

    def write(self, size: int) -> bytes:
        """Log something; gives what the present log contains."""
        if self._open is None:
            return b""
        self._open.contents += random.Random(size).randbytes(size)
        if not self._dates_opening:
            self._open.changed_s = self.now_s
        return self._open.contents

    def disarm(self) -> None:
        """Disarm; the log stays open."""
        self._is_armed = False
        self._persists_until = self.now_s + PERSISTS_S

    def close_log(self) -> None:
        """Close the open log, as LOG_FILE_DSRMROT does."""
        self._open = None

    def step(self, step_s: float = 0.004) -> list[Message]:
        """Let some time pass; gives what has arrived at the client."""
        self.now_s += step_s
        self.link.advance(round(self.now_s * 1e6))
        for datagram, _ in self.link.vehicle.receive():
            for message in self._wire.decode(datagram):
                self._handle(message)
        if self._closes_logs and not self._is_armed and self.now_s >= self._persists_until:
            self.close_log()
        if self._open is None and (self._logs_disarmed or self.now_s < self._persists_until):
            self._begin_log()
        if not self._is_armed:
            self._serve(step_s)
        datagrams = self.link.ground.receive()
        return [one for datagram, _ in datagrams for one in self._decoder.decode(datagram)]

    def send(self, messages: list[Message]) -> None:
        """Send to the vehicle."""
        for message in messages:
            self.requests += message.get_type() == "LOG_REQUEST_DATA"
            self.link.ground.send(self._encoder.encode(message), VEHICLE_ADDRESS)

    def _begin_log(self) -> None:
        self._open = StoredLog(b"\xa3\x95" * 50, self.now_s)
        self.files.append(self._open)

    @property
    def _numbers(self) -> range:
        return range(1, len(self.files) + 1)

    @property
    def _is_busy(self) -> bool:
        return bool(self._listing) or self._sending is not None

    def _handle(self, message: Message) -> None:
        kind = message.get_type()
        if self._is_armed:
            return
        if kind == "LOG_REQUEST_END":
            self._listing, self._sending = [], None
        elif kind == "LOG_REQUEST_LIST" and not self._is_busy:
            self._last_listed = min(message.end, len(self.files))
            first = max(message.start, 1) if self.files else 0
            self._listing = list(range(first, self._last_listed + 1))
        elif kind == "LOG_REQUEST_DATA" and not self._is_busy and message.id in self._numbers:
            self.close_log()
            end = min(message.ofs + message.count, len(self.files[message.id - 1].contents))
            self._sending = message.id, message.ofs, max(message.ofs, end)

    def _serve(self, step_s: float) -> None:
        self._allowance = min(self._allowance + step_s, 0.01)
        while self._listing and self._allowance >= 1.0 / ENTRIES_PER_S:
            self._allowance -= 1.0 / ENTRIES_PER_S
            self._send_entry(self._listing.pop(0))
        while self._sending and self._allowance >= 1.0 / PACKETS_PER_S:
            self._allowance -= 1.0 / PACKETS_PER_S
            self._send_data(*self._sending)

    def _send_entry(self, number: int) -> None:
        count, time_s, size = len(self.files), 0, 0
        if number:
            log = self.files[number - 1]
            is_open = log is self._open
            clock_s = self.now_s if is_open else log.changed_s + self._file_clock_s
            time_s, size = int(self._boot_s + clock_s), len(log.contents)
        self._send(
            mavlink.MAVLink_log_entry_message(number, count, self._last_listed, time_s, size)
        )

    def _send_data(self, number: int, offset: int, end: int) -> None:
        data = self.files[number - 1].contents[offset : min(offset + 90, end)]
        self._send(
            mavlink.MAVLink_log_data_message(number, offset, len(data), list(data.ljust(90, b"\0")))
        )
        is_over = len(data) < 90 or offset + len(data) >= end
        self._sending = None if is_over else (number, offset + len(data), end)

    def _send(self, message: Message) -> None:
        self.link.vehicle.send(self._wire.encode(message), GROUND_ADDRESS)
