"""The vehicle's messages on the wire, in the order in which MAVSDK sends them."""

import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from sim.tester.vehicle.actions import FinishCommand
from sim.tester.vehicle.events import Armed, Command, MissionReceived
from sim.tester.vehicle.mavsdk_link import MavsdkVehicle
from sim.tester.vehicle.mission_steps import Item
from sim.tester.vehicle.stand_in import StandIn
from sim.tester.vehicle.telemetry import Home

HOME = Home(40.44340, -3.73820, 650.0)
MISSION_START = 300
WAYPOINTS = tuple(
    Item(
        command=number,
        param1=0.0,
        param2=0.0,
        param3=0.0,
        param4=0.0,
        x=404434000,
        y=-37382000,
        z=4.0,
    )
    for number in (22, 16, 20)
)


@pytest.fixture
def broker() -> Iterator[socket.socket]:
    """The broker's end of the link; a silence of 0.5 s ends a read."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        opened.settimeout(0.5)
        yield opened


def received(broker: socket.socket) -> list[Any]:
    """All messages until the link is silent."""
    decoder = common.MAVLink(None)
    messages: list[Any] = []
    while True:
        try:
            messages += decoder.parse_buffer(broker.recv(4096)) or []
        except TimeoutError:
            return messages


def test_what_was_observed_comes_before_the_end_of_its_command(broker: socket.socket) -> None:
    vehicle = StandIn(HOME, time.monotonic())
    link = MavsdkVehicle(1, f"udpout://127.0.0.1:{broker.getsockname()[1]}", lambda _: None)
    try:
        now = time.monotonic()
        start = Command(number=MISSION_START, parameters=(0.0,) * 7)
        for event in (MissionReceived(WAYPOINTS), Armed(armed=True), start):
            vehicle.receive(event, now)
        link.publish(vehicle, now)
        received(broker)
        current = vehicle.mission.current
        for order in vehicle.act(FinishCommand(), now):
            link.carry_out(order, vehicle, now)
        names = [
            message.get_type()
            for message in received(broker)
            if message.get_type() != "MISSION_CURRENT" or message.seq > current
        ]
    finally:
        link.close()
    assert vehicle.mission.current > current
    assert {"TUNNEL", "BATTERY_STATUS", "GLOBAL_POSITION_INT"} <= set(names)
    shows_the_end = names.index("MISSION_CURRENT")
    for result in ("GLOBAL_POSITION_INT", "TUNNEL", "BATTERY_STATUS"):
        assert names.index(result) < shows_the_end, names
