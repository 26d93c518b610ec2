"""Missions over real lines and connections, with everything that goes wrong on them.

Bytes go through the kernel's terminals and sockets; time is simulated, so that a line of 57,600
baud is exactly as slow as it should be.
"""

import dataclasses
import os
import random
import socket
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Final, Protocol, Self

import pytest

from mavlink_broker.app import App
from mavlink_broker.config import Config, LinkSettings
from mavlink_broker.links.hub import open_links
from mavlink_broker.links.link import FrameScanner
from mavlink_broker.links.url import LinkUrl
from mavlink_broker.mavlink.codec import Encoder
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import FINISHED, Clock, first_flight
from tests.support.fake_edge import FakeEdge
from tests.support.link_ends import Cable
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import PX4

TICK_S: Final = 0.02
BYTES_PER_TICK: Final = round(57_600 / 10 * TICK_S)
HOST: Final = "127.0.0.1"
SLOW: Final = dataclasses.replace(PX4, item_time_s=5.0)


class Line(Protocol):
    """What lies between vehicle and broker, from the vehicle's end."""

    def write(self, frames: list[bytes]) -> None:
        """Send frames to the broker, as far as they get through."""

    def read(self) -> bytes:
        """What has come from the broker."""


class Field:
    """A broker with real links, a vehicle at the other end, and time that a test lets pass."""

    def __init__(self, line: Line, *urls: str, vehicles: int = 1) -> None:
        self.clock = Clock()
        self.line = line
        links = tuple(map(LinkUrl.parse, urls))
        self.hub = open_links(links, self.clock.monotonic)
        self.edge = FakeEdge()
        config = Config(traffic=LinkSettings(links=links))
        ulids = count(1)
        self.app = App(config, self.hub, self.edge, self.clock, lambda: f"01{next(ulids):024d}")
        self.vehicles = [
            ScriptedVehicle(n + 1, SLOW, booted_at=self.clock.now) for n in range(vehicles)
        ]
        self._scanner = FrameScanner()

    def tick(self) -> None:
        self.clock.now += TICK_S
        frames = [frame for v in self.vehicles for frame in v.step(self.clock.now)]
        self.line.write(frames)
        self.app.step(0.0)
        for frame in self._scanner.feed(self.line.read(), self.clock.now):
            for vehicle in self.vehicles:
                vehicle.receive(frame, self.clock.now)

    def run_until_over(self, mission_id: int, within_s: float) -> None:
        end = self.clock.now + within_s
        while (self.edge.status(mission_id) or 0) < 3:
            assert self.clock.now < end, f"not within {within_s} s"
            self.tick()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.app.close()
        self.hub.close()


class SlowRadio:
    """A serial line of 57,600 baud that others share and that spoils bytes."""

    def __init__(self, cable: Cable, seed: int = 1) -> None:
        self._cable = cable
        self._chance = random.Random(seed)
        self._others = [Encoder(system, 1) for system in range(101, 120)]
        self._ticks = 0
        self.lost = self.carried = 0

    def write(self, frames: list[bytes]) -> None:
        """Carry as much as the line can, in any order, with noise between."""
        self._ticks += 1
        air = [*frames, *self._from_others()]
        self._chance.shuffle(air)
        room = BYTES_PER_TICK
        for frame in air:
            noise = self._chance.randbytes(self._chance.choice((0, 0, 0, 7)))
            room -= len(noise) + len(frame)
            if room < 0:
                self.lost += 1
                continue
            self.carried += 1
            self._cable.write(noise + frame)

    def read(self) -> bytes:
        return self._cable.read(BYTES_PER_TICK)

    def _from_others(self) -> list[bytes]:
        """Nineteen more vehicles: heartbeats, and five times a second where they are."""
        frames = []
        heartbeat = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
        place = (404_434_000, -37_382_000, 650_000, 0, 0, 0, 0, 0)
        position = mavlink.MAVLink_global_position_int_message(self._ticks * 20, *place)
        for number, encoder in enumerate(self._others):
            if (self._ticks + 7 * number) % 50 == 0:
                frames.append(encoder.encode(heartbeat))
            if (self._ticks + number) % 10 == 0:
                frames.append(encoder.encode(position))
        return frames


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Cable]:
    one = Cable(tmp_path / "ttyRADIO")
    one.plug_in()
    yield one
    one.pull_out()


@pytest.mark.thorough
def test_a_mission_over_a_radio_that_twenty_vehicles_share(cable: Cable) -> None:
    radio = SlowRadio(cable)
    with Field(radio, f"serial://{cable.name}:57600") as field:
        field.edge.plan(first_flight())
        field.run_until_over(1201, within_s=240.0)
        assert field.edge.statuses(1201) == FINISHED
        assert radio.lost > 100
        assert len(field.app.sessions) == 20


class Unplugged:
    """A cable that is pulled out now and then, for two seconds each time."""

    def __init__(self, cable: Cable, every_s: float) -> None:
        self._cable = cable
        self._period = round(every_s / TICK_S)
        self._ticks = 0
        self.is_plugged_in = True
        self.pulls = 0

    def write(self, frames: list[bytes]) -> None:
        self._ticks += 1
        if self._ticks % self._period == 0:
            self._cable.pull_out()
            self.is_plugged_in = False
            self.pulls += 1
        elif self._ticks % self._period == round(2.0 / TICK_S) and not self.is_plugged_in:
            self._cable.plug_in()
            self.is_plugged_in = True
        if self.is_plugged_in:
            self._cable.write(b"".join(frames))

    def read(self) -> bytes:
        return self._cable.read() if self.is_plugged_in else b""


def test_a_mission_over_a_cable_that_is_pulled_out_again_and_again(cable: Cable) -> None:
    line = Unplugged(cable, every_s=9.0)
    with Field(line, f"serial://{cable.name}:115200") as field:
        field.edge.plan(first_flight())
        field.run_until_over(1201, within_s=240.0)
        while not line.is_plugged_in:
            field.tick()
        assert field.edge.statuses(1201) == FINISHED
        assert line.pulls >= 2
        assert field.vehicles[0].uploads <= 2


class Server:
    """The vehicle's TCP port, as ArduPilot's simulator has one; hangs up now and then."""

    def __init__(self, every_s: float) -> None:
        self._listener = socket.create_server((HOST, 0))
        self._listener.settimeout(0.0)
        self._client: socket.socket | None = None
        self._period = round(every_s / TICK_S)
        self._ticks = 0
        self.hang_ups = 0
        self.port = int(self._listener.getsockname()[1])

    def write(self, frames: list[bytes]) -> None:
        self._ticks += 1
        if self._client is None:
            self._accept()
        elif self._ticks % self._period == 0:
            self.hang_ups += 1
            self.close()
        if self._client is not None:
            self._client.setblocking(True)
            self._client.sendall(b"".join(frames))
            self._client.setblocking(False)

    def read(self) -> bytes:
        if self._client is None:
            return b""
        try:
            return self._client.recv(65_536)
        except BlockingIOError:
            return b""

    def close(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None

    def end(self) -> None:
        self.close()
        self._listener.close()

    def _accept(self) -> None:
        try:
            self._client, _ = self._listener.accept()
        except BlockingIOError:
            return


def test_a_mission_over_tcp_whose_server_hangs_up_again_and_again() -> None:
    server = Server(every_s=9.0)
    with Field(server, f"tcp://{HOST}:{server.port}") as field:
        field.edge.plan(first_flight())
        field.run_until_over(1201, within_s=240.0)
        assert field.edge.statuses(1201) == FINISHED
        assert server.hang_ups >= 2
    server.end()


class TwoWays:
    """Wifi by UDP and a cable at once; one or the other is away for a while."""

    def __init__(self, cable: Cable, port: int) -> None:
        self._cable = cable
        self._to = (HOST, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.0)
        self._socket.bind((HOST, 0))
        self._ticks = 0
        self.received_by: list[str] = []

    @property
    def _has_wifi(self) -> bool:
        """Away for four seconds of ten."""
        return self._ticks * TICK_S % 10.0 < 6.0

    def write(self, frames: list[bytes]) -> None:
        self._ticks += 1
        for frame in frames:
            self._cable.write(frame)
            if self._has_wifi:
                self._socket.sendto(frame, self._to)

    def read(self) -> bytes:
        by_cable = self._cable.read()
        self.received_by += ["cable"] if by_cable else []
        by_wifi = b""
        try:
            while data := self._socket.recv(4096):
                self.received_by.append("wifi")
                by_wifi += data if self._has_wifi else b""
        except BlockingIOError:
            pass
        return by_cable + by_wifi

    def close(self) -> None:
        self._socket.close()


def test_a_mission_over_two_links_one_of_which_comes_and_goes(cable: Cable) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        port = int(probe.getsockname()[1])
    line = TwoWays(cable, port)
    with Field(line, f"udpin://{HOST}:{port}", f"serial://{cable.name}:57600") as field:
        field.edge.plan(first_flight())
        field.run_until_over(1201, within_s=120.0)
        assert field.edge.statuses(1201) == FINISHED
        assert field.vehicles[0].uploads == 1
        assert {"cable", "wifi"} == set(line.received_by)
        assert len(field.edge.bodies("/pose/")) == len(FINISHED)
    line.close()


def test_a_modem_that_waits_to_be_spoken_to_flies_too() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as modem:
        modem.settimeout(0.0)
        modem.bind((HOST, 0))
        line = Waiting(modem)
        with Field(line, f"udpout://{HOST}:{modem.getsockname()[1]}") as field:
            field.edge.plan(first_flight())
            field.run_until_over(1201, within_s=120.0)
            assert field.edge.statuses(1201) == FINISHED


class Waiting:
    """Sends nothing before it has received a datagram, and then to its sender."""

    def __init__(self, modem: socket.socket) -> None:
        self._modem = modem
        self._to: tuple[str, int] | None = None

    def write(self, frames: list[bytes]) -> None:
        for frame in frames if self._to else ():
            assert self._to is not None
            self._modem.sendto(frame, self._to)

    def read(self) -> bytes:
        data_read = b""
        try:
            while True:
                data, self._to = self._modem.recvfrom(4096)
                data_read += data
        except BlockingIOError:
            return data_read


def test_a_line_full_of_hostile_bytes_never_stops_the_loop(cable: Cable) -> None:
    with Field(Hostile(cable), f"serial://{cable.name}:57600") as field:
        field.edge.plan(first_flight())
        field.run_until_over(1201, within_s=240.0)
        assert field.edge.statuses(1201) == FINISHED


class Hostile:
    """Between all frames: first bytes, lengths, cut frames, whatever looks like a beginning."""

    def __init__(self, cable: Cable) -> None:
        self._cable = cable
        self._chance = random.Random(3)

    def write(self, frames: list[bytes]) -> None:
        for frame in frames:
            cut = frame[: self._chance.randrange(len(frame))]
            hostile = (b"\xfd\xff\x00", b"\xfe" * 30, cut, os.urandom(20), b"\xfd\x09\x01")
            self._cable.write(self._chance.choice(hostile) + frame)

    def read(self) -> bytes:
        return self._cable.read()
