"""The whole vehicle's rhythm: how much of its time may pass without a look at the wall clock."""

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester
from tests.support.ground_station import ADDRESS
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.msg.control_mode import ControlLevel, ControlSource, VehicleControlMode


@pytest.fixture
def tester(tmp_path: Path) -> Iterator[AutopilotTester]:
    """Give a vehicle that stands, and the operator whom it knows as its ground station."""
    peers = (Peer(address=ADDRESS, profile=Profile.GROUND_STATION),)
    tester = AutopilotTester(SimulationConfig(), tmp_path, peers=peers)
    tester.run_for(1.0)
    yield tester
    tester.simulation.close()


def test_each_topic_is_published_as_often_as_it_is_declared(tester: AutopilotTester) -> None:
    topics = tester.autopilot.topics
    declared = {entry.name: entry.metadata.get("rate_hz", 0.0) for entry in fields(topics)}
    periodic = {name: rate for name, rate in declared.items() if rate > 0.0}
    before = {name: getattr(topics, name).count for name in periodic}
    tester.run_for(2.0)
    rates = {name: (getattr(topics, name).count - before[name]) / 2.0 for name in periodic}
    assert rates.pop("vehicle_status") >= periodic["vehicle_status"]  # And on change
    for name in ("vehicle_global_position", "geofence_status"):  # Not before a position is known
        del rates[name]
    assert rates == pytest.approx({name: periodic[name] for name in rates}, rel=0.01)


def test_no_peer_waits_for_an_idle_vehicle(tester: AutopilotTester) -> None:
    assert not tester.autopilot.is_command_pending()


def test_a_command_is_waited_for_until_it_has_been_answered(tester: AutopilotTester) -> None:
    station, autopilot = tester.ground_station, tester.autopilot
    station.command(common.MAV_CMD_DO_SET_HOME, 1.0)
    autopilot.serve_link()
    assert autopilot.is_command_pending()
    tester.wait_until(lambda: not autopilot.is_command_pending(), 0.1, "answered")
    station.receive()
    assert common.MAV_CMD_DO_SET_HOME in [command for command, _ in station.acks]


def test_a_vehicle_led_by_sticks_or_setpoints_looks_up_more_often(tester: AutopilotTester) -> None:
    autopilot = tester.autopilot
    watched_us = autopilot.batch_us()
    for source in (ControlSource.MANUAL, ControlSource.OFFBOARD):
        autopilot.topics.vehicle_control_mode.publish(
            VehicleControlMode(autopilot.vehicle.time_us, source, ControlLevel.POSITION)
        )
        assert autopilot.batch_us() < watched_us


def test_a_batch_is_no_longer_than_the_fastest_telemetry_needs(tester: AutopilotTester) -> None:
    station, autopilot = tester.ground_station, tester.autopilot
    before_us = autopilot.batch_us()
    station.command(common.MAV_CMD_SET_MESSAGE_INTERVAL, common.MAVLINK_MSG_ID_ATTITUDE, 50_000.0)
    autopilot.serve_link()
    assert autopilot.batch_us() == 50_000 < before_us


def test_a_peer_that_has_timed_out_does_not_count(tester: AutopilotTester) -> None:
    autopilot = tester.autopilot
    watched_us = autopilot.batch_us()
    tester.heartbeats = False
    tester.run_for(6.0)
    assert autopilot.batch_us() > watched_us


def test_every_parameter_survives_a_restart(tmp_path: Path) -> None:
    """Whichever module declares it: the camera's were dropped, and the file was emptied."""
    first = AutopilotTester(SimulationConfig(), tmp_path)
    registry = first.autopilot.registry
    for name in registry.names():
        declaration = registry.declaration(name)
        for value in (declaration.maximum, declaration.minimum):
            if value != registry.get(name) and abs(value) < 1e9:
                registry.set(name, value)
                break
    changed = registry.changed()
    assert "CAM_IMAGE_SECOND" in changed
    assert first.autopilot.parameter_storage.finish() == ""
    first.simulation.close()
    second = AutopilotTester(SimulationConfig(), tmp_path)
    lost = {
        name: (value, second.autopilot.registry.get(name))
        for name, value in changed.items()
        if second.autopilot.registry.get(name) != value
    }
    second.simulation.close()
    assert len(changed) > 100
    assert not lost
