"""A ground station on the forwarding port of a whole broker, from mission to mission."""

from typing import Any

from afarcloud.enumerations import Status
from mavlink_broker.app import STARTUP_S
from mavlink_broker.config import Config, LinkSettings
from mavlink_broker.links.url import Address, LinkUrl
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import FINISHED, World, first_flight
from tests.support.scripted_vehicle import ScriptedVehicle

STATION = Address("127.0.0.1", 50_000, 1)
ARM, LAND = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_LAND


class GroundStationWorld:
    """A world with one vehicle, and a ground station beside its broker."""

    def __init__(self, *, may_command: bool = False) -> None:
        settings = LinkSettings(
            forward=(LinkUrl.parse("udpin://127.0.0.1:14551"),), forward_commands=may_command
        )
        self.world = World(config=Config(traffic=settings))
        self.vehicle: ScriptedVehicle = self.world.add_vehicle()
        self._encoder = Encoder(255, 190)
        self.answers: list[Any] = []
        self._send, self.world.air.send = self.world.air.send, self._sort  # type: ignore[method-assign]
        self.world.run(3.0)

    def _sort(self, address: Address, frame: bytes) -> None:
        if address == STATION:
            self.answers += Decoder().decode(frame)
        else:
            self._send(address, frame)

    def command(self, number: int, *parameters: float) -> int | None:
        """Send a command; returns the result that the ground station receives."""
        p = [*parameters, *[0.0] * (7 - len(parameters))]
        message = mavlink.MAVLink_command_long_message(1, 1, number, 0, *p)
        self.world.air.to_broker(STATION, self._encoder.encode(message))
        self.answers.clear()
        self.world.run(0.5)
        results = [
            int(m.result)
            for m in self.answers
            if m.get_type() == "COMMAND_ACK" and m.command == number
        ]
        return results[-1] if results else None


def test_without_a_mission_a_ground_station_flies_the_vehicle() -> None:
    station = GroundStationWorld()
    assert station.command(ARM, 1.0) == mavlink.MAV_RESULT_ACCEPTED
    assert station.vehicle.armed


def test_during_a_mission_it_watches_and_afterwards_it_flies_again() -> None:
    station = GroundStationWorld()
    station.world.edge.plan(first_flight())
    station.world.run_until(lambda: station.world.edge.status(1201) == Status.RUNNING)
    assert station.command(LAND) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    assert station.command(ARM, 0.0, 21196.0) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    station.world.run_until_over(1201)
    assert station.world.edge.statuses(1201) == FINISHED
    assert station.command(ARM, 1.0) == mavlink.MAV_RESULT_ACCEPTED


def test_where_it_may_command_it_ends_the_mission() -> None:
    station = GroundStationWorld(may_command=True)
    station.world.edge.plan(first_flight())
    station.world.run_until(lambda: station.world.edge.status(1201) == Status.RUNNING)
    assert station.command(LAND) == mavlink.MAV_RESULT_ACCEPTED
    station.world.run_until_over(1201)
    assert station.world.edge.status(1201) == Status.FAILED


def test_a_restarted_broker_protects_a_flying_mission_before_it_knows_it() -> None:
    station = GroundStationWorld()
    world = station.world
    world.edge.plan(first_flight())
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.start_broker()  # The edge server is silent
    world.run(3.0)
    assert station.command(LAND) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    world.run(STARTUP_S)
    assert station.command(ARM, 1.0) == mavlink.MAV_RESULT_ACCEPTED


def test_a_ground_station_cannot_lower_the_rate_of_positions() -> None:
    station = GroundStationWorld()
    position = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    before = len(station.vehicle.commands)
    interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    assert station.command(interval, position, -1.0) == mavlink.MAV_RESULT_ACCEPTED
    asked = station.vehicle.parameters[before:]
    assert not [p for number, p in asked if number == interval and p[:2] == (position, -1.0)]
