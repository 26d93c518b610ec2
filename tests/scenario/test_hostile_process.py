"""The real programs under fire, over real sockets."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as mavlink

from sim.launch.farm_client import rows
from tests.conformance.ground_station import GroundStation, vehicle_process
from tests.support.hostile_frames import HostileFrames
from tests.support.system import free_ports, running, short_plan, wait_for
from tests.support.truth import horizontal_distance_m, read_track

pytestmark = pytest.mark.scenario

SYSTEM = 7
FRAMES = 6_000
BURST = 40
STILL_M = 0.05


@contextmanager
def udp_sockets(count: int) -> Iterator[list[socket.socket]]:
    with ExitStack() as stack:
        yield [
            stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            for _ in range(count)
        ]


@contextmanager
def ground_station(own: int, vehicle: int) -> Iterator[GroundStation]:
    station = GroundStation(own, vehicle, SYSTEM)
    try:
        yield station
    finally:
        station.close()


def test_a_vehicle_on_an_open_link_answers_on_and_stands_still(tmp_path: Path) -> None:
    own, broker, ground = free_ports(3)
    frames = HostileFrames(1, SYSTEM, is_harmless=True)
    with (
        vehicle_process(SYSTEM, 5.0, (own, broker, ground), tmp_path),
        ground_station(ground, own) as station,
        udp_sockets(3) as enemies,
    ):
        station.until(lambda m: m.get_type() == "HEARTBEAT", "the vehicle")
        for number in range(FRAMES):
            enemies[number % len(enemies)].sendto(next(frames).contents, ("127.0.0.1", own))
            if number % BURST == 0:
                station.hear()
        request = mavlink.MAVLink_command_long_message(SYSTEM, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0)
        station.ask(request, "AUTOPILOT_VERSION")
        assert station.command(400, 1.0, 21196.0) == mavlink.MAV_RESULT_ACCEPTED
        assert station.command(400, 0.0, 21196.0) == mavlink.MAV_RESULT_ACCEPTED
    track = read_track(tmp_path / f"vehicle-{SYSTEM}" / "truth.csv")
    start = track[0]
    for position in track:
        away_m = horizontal_distance_m(position, start.latitude_deg, start.longitude_deg)
        assert away_m < STILL_M
        assert abs(position.height_above_home_m - start.height_above_home_m) < STILL_M


def test_on_the_signed_link_nobody_impersonates_a_vehicle_or_the_broker(tmp_path: Path) -> None:
    with running(tmp_path) as system, udp_sockets(1) as (enemy,):
        to_broker = ("127.0.0.1", system.settings.mavlink_port)
        heartbeat = mavlink.MAVLink_heartbeat_message(2, 12, 217, 0x03040000, 4, 3)
        report = mavlink.MAVLink_mission_current_message(0, 3, 5, 1)
        for vehicle in (1, 9):
            codec = mavlink.MAVLink(None, vehicle, 1)
            for message in (heartbeat, report):
                enemy.sendto(message.pack(codec), to_broker)
        wait_for(lambda: "MAVLink frames refused" in system.log_of("broker"), "the refusal")
        system.fly(short_plan())
        assert [one["vehicle_id"] for one in rows(system.get("/vehicles/"))] == [1]
