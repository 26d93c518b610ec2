"""A mission on our own vehicle over a telemetry radio of 57,600 baud that is pulled out and back.

The vehicle sends UDP; the link between its datagrams and the broker's serial line is as slow as
the radio, loses what it cannot queue, and is unplugged for some seconds again and again.
"""

import select
import socket
import threading
import time
from collections import Counter, deque
from pathlib import Path
from typing import Any, Final, Self

from tests.support.link_ends import Cable
from tests.support.system import FarmSystem, example_plan

BYTES_S: Final = 57_600 / 10
QUEUE_BYTES: Final = 2048
"""What a radio keeps before it throws away."""
PLUGGED_S: Final = 17.0
PULLED_S: Final = 4.0
_TICK_S: Final = 0.005
_LARGEST: Final = 4096


class Radio:
    """Carries frames between a UDP port, at which the vehicle aims, and a pseudo-terminal."""

    def __init__(self, port: int, cable: Cable) -> None:
        self.counts: Counter[str] = Counter()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.setblocking(False)
        self._cable = cable
        self._vehicle: tuple[str, int] | None = None
        self._queue: deque[bytes] = deque()
        self._queued = 0
        self._up = self._down = 0.0  # [bytes] That may go now
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        last, began, is_plugged = time.monotonic(), time.monotonic(), True
        while not self._stop.is_set():
            select.select([self._socket], [], [], _TICK_S)
            now = time.monotonic()
            self._up, self._down = (
                min(room + (now - last) * BYTES_S, BYTES_S / 10) for room in (self._up, self._down)
            )
            last = now
            wanted = (now - began) % (PLUGGED_S + PULLED_S) < PLUGGED_S
            if wanted != is_plugged:
                (self._cable.plug_in if wanted else self._cable.pull_out)()
                self.counts["pulled out"] += not wanted
                is_plugged = wanted
            self._take()
            if is_plugged:
                self._carry()

    def _take(self) -> None:
        try:
            while True:
                data, self._vehicle = self._socket.recvfrom(_LARGEST)
                if self._queued + len(data) > QUEUE_BYTES:
                    self.counts["lost"] += 1
                    continue
                self._queue.append(data)
                self._queued += len(data)
        except BlockingIOError:
            return

    def _carry(self) -> None:
        while self._queue and self._up >= len(self._queue[0]):
            frame = self._queue.popleft()
            self._queued -= len(frame)
            self._up -= len(frame)
            self._cable.write(frame)
            self.counts["carried"] += 1
        if self._down >= 1.0 and (data := self._cable.read(int(self._down))):
            self._down -= len(data)
            self.counts["bytes to the vehicle"] += len(data)
            if self._vehicle is not None:
                self._socket.sendto(data, self._vehicle)


def run(folder: Path) -> tuple[dict[str, Any], Counter[str]]:
    """Fly the first plan in real time; gives the plan as it ended, and what the radio did."""
    cable = Cable(folder / "ttyRADIO")
    cable.plug_in()
    with (
        FarmSystem(folder / "var", speed=1.0) as system,
        Radio(system.settings.mavlink_port, cable) as radio,
    ):
        system.environment["LINKS"] = f"serial://{cable.name}:57600"
        system.start().wait_until_connected()
        return system.fly(example_plan()), radio.counts
