"""The other ends of links: a pseudo-terminal that can be unplugged, a hub in a loop, a vehicle."""

import os
import pty
import select
import socket
import termios
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mavlink_broker.links.hub import Hub
from mavlink_broker.links.link import Arrival
from tests.support.scripted_vehicle import ScriptedVehicle

PATIENCE_S = 30.0
FLIGHT_S = 60.0
"""How long a mission lasts at most, in real time."""


class Cable:
    """A pseudo-terminal under a fixed name, as udev gives a radio; plugged in and pulled out."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self._far: int | None = None
        self._near: int | None = None

    def plug_in(self) -> None:
        self._far, self._near = pty.openpty()
        tty.setraw(self._near)
        os.set_blocking(self._far, False)
        self.name.symlink_to(os.ttyname(self._near))

    def pull_out(self) -> None:
        self.name.unlink()
        for descriptor in (self._near, self._far):
            assert descriptor is not None
            os.close(descriptor)
        self._far = self._near = None

    def close(self) -> None:
        """Pull the cable out, if it is plugged in."""
        if self._far is not None:
            self.pull_out()

    def modes(self) -> list[Any]:
        """Settings of the program's end, as of `termios.tcgetattr`."""
        assert self._near is not None
        return termios.tcgetattr(self._near)

    def write(self, data: bytes) -> None:
        """Send to the program all that the line takes at once."""
        assert self._far is not None
        os.write(self._far, data)

    def read(self, most: int = 65_536) -> bytes:
        """What the program has sent."""
        assert self._far is not None
        try:
            return os.read(self._far, most)
        except BlockingIOError:
            return b""


def receive_until(hub: Hub, is_enough: Callable[[list[Arrival]], bool]) -> list[Arrival]:
    """Receive until the condition holds."""
    arrivals: list[Arrival] = []
    end = time.monotonic() + PATIENCE_S
    while not is_enough(arrivals):
        assert time.monotonic() < end, f"only {len(arrivals)} arrivals"
        arrivals += hub.receive(0.02)
    return arrivals


def fly_over_udp(vehicle: ScriptedVehicle, port: int, is_over: Callable[[], bool]) -> None:
    """Let a vehicle live on a real socket in real time."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        end = time.monotonic() + FLIGHT_S
        while not is_over():
            assert time.monotonic() < end, "the mission does not end"
            if select.select([own], [], [], 0.005)[0]:
                vehicle.receive(own.recv(2048), time.monotonic())
            for frame in vehicle.step(time.monotonic()):
                own.sendto(frame, ("127.0.0.1", port))
