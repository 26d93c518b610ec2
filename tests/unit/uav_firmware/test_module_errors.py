"""An error in one module of a flying vehicle: the others fly on, and the truth judges."""

from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import AutopilotTester
from tests.support.ground_station import ADDRESS
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.modules.navigator.mission.review import NOT_CHECKED, MissionReview
from uav_firmware.msg.mission import PlanReview
from uav_firmware.msg.status import NavigationState
from uav_firmware.scheduler import Scheduler

HEIGHT_M = 8.0


class BrokenVehicle:
    """A vehicle whose modules can be made to raise."""

    def __init__(self, folder: Path) -> None:
        peers = (Peer(address=ADDRESS, profile=Profile.GROUND_STATION),)
        config = SimulationConfig(gps="rtk")
        self.tester = AutopilotTester(config, folder, peers=peers, on_error=None)
        self.broken: set[str] = set()
        former = self.tester.autopilot.scheduler
        groups = [
            group._replace(run=self._breakable(group.name, group.run)) for group in former.groups
        ]
        self.tester.autopilot.scheduler = Scheduler(former.step_us, groups, former.on_error)
        self.tester.wait_until_ready()

    def hover(self) -> None:
        """Take off and hold."""
        self.tester.take_off(HEIGHT_M)
        self.tester.wait_until(
            lambda: self.tester.mode is NavigationState.AUTO_LOITER, 30.0, "holding"
        )

    def fail(self, module: str, seconds: float) -> None:
        """Let a module raise whenever it runs for so long."""
        self.broken.add(module)
        self.tester.run_for(seconds)
        self.broken.discard(module)

    @property
    def height_m(self) -> float:
        return self.tester.true_position()[2]

    def _breakable(self, name: str, run: Callable[[], None]) -> Callable[[], None]:
        def run_or_fail() -> None:
            if name in self.broken:
                raise ZeroDivisionError(f"{name} is broken")
            run()

        return run_or_fail


@pytest.fixture
def vehicle(tmp_path: Path) -> BrokenVehicle:
    return BrokenVehicle(tmp_path)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("module", "seconds"),
    [
        ("navigator", 0.4),
        ("mavlink", 3.0),
        ("logger", 3.0),
        ("payload", 3.0),
        ("commander", 1.0),
        ("position_control", 0.1),
        ("estimator", 0.02),
        ("rate_control", 0.02),
    ],
)
def test_a_vehicle_flies_on_after_an_error_of_a_module(
    vehicle: BrokenVehicle, module: str, seconds: float
) -> None:
    vehicle.hover()
    vehicle.fail(module, seconds)
    vehicle.tester.run_for(5.0)
    assert vehicle.height_m == pytest.approx(HEIGHT_M, abs=0.5)
    vehicle.tester.land()
    vehicle.tester.wait_until(lambda: not vehicle.tester.status.armed, 60.0, "landed")


def test_a_vehicle_without_a_navigator_comes_down_slowly(vehicle: BrokenVehicle) -> None:
    vehicle.hover()
    speeds_down: list[float] = []
    vehicle.tester.watch(lambda: speeds_down.append(vehicle.tester.truth.velocity_ned[2]))
    vehicle.broken.add("navigator")
    vehicle.tester.wait_until(lambda: vehicle.tester.landed, 60.0, "landed")
    assert max(speeds_down) < 1.0
    assert not vehicle.tester.simulation.wrecked


def test_the_operator_learns_of_an_error_and_the_log_has_its_traceback(
    vehicle: BrokenVehicle,
) -> None:
    vehicle.hover()
    vehicle.fail("navigator", 0.1)
    vehicle.tester.run_for(1.0)
    assert "Internal error in navigator" in vehicle.tester.ground_station.texts
    lines = "\n".join(vehicle.tester.lines)
    assert lines.count("Traceback") == 1
    assert "ZeroDivisionError: navigator is broken" in lines
    assert "navigator: internal error 1: ZeroDivisionError('navigator is broken')" in lines


def test_an_error_that_goes_on_is_reported_every_ten_seconds(vehicle: BrokenVehicle) -> None:
    before = len(vehicle.tester.lines)
    vehicle.fail("logger", 12.0)
    lines = [line for line in vehicle.tester.lines[before:] if "internal error" in line]
    numbers = [line.split("internal error ")[1].split(":")[0] for line in lines]
    assert numbers == ["1", "2501"]


def test_a_vehicle_with_an_error_is_not_armed_before_its_restart(vehicle: BrokenVehicle) -> None:
    vehicle.fail("payload", 0.1)
    vehicle.tester.run_for(1.0)
    assert not vehicle.tester.status.preflight_checks_pass
    station = vehicle.tester.ground_station
    station.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    vehicle.tester.run_for(1.0)
    assert station.acks[-1][1] != common.MAV_RESULT_ACCEPTED
    assert "Internal error in payload: restart" in "".join(station.texts)


def test_an_error_in_the_answer_to_a_datagram_is_one_of_the_link(
    vehicle: BrokenVehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_time_us: int) -> None:
        raise ValueError("a datagram")

    monkeypatch.setattr(vehicle.tester.autopilot.mavlink, "serve", fail)
    vehicle.tester.autopilot.serve_link()
    errors = vehicle.tester.autopilot.topics.internal_errors.value
    assert errors is not None
    assert errors.modules == ("mavlink",)


def test_motors_stop_when_nobody_commands_them(vehicle: BrokenVehicle) -> None:
    vehicle.tester.arm()
    vehicle.tester.run_for(1.0)
    assert max(vehicle.tester.simulation.truth.rotor_rpm) > 100.0
    vehicle.fail("control_allocator", 3.0)
    assert max(vehicle.tester.simulation.truth.rotor_rpm) < 100.0


def test_a_plan_whose_check_fails_is_refused(
    vehicle: BrokenVehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_items: object) -> PlanReview:
        yield 1
        raise ValueError("a check")

    monkeypatch.setattr(vehicle.tester.autopilot.navigator, "_review_mission", fail)
    station = vehicle.tester.ground_station
    station.upload(
        [station.mission_item(0, common.MAV_CMD_NAV_TAKEOFF, vehicle.tester.place(0.0, 0.0, 5.0))]
    )
    vehicle.tester.wait_until(lambda: station.mission_ack is not None, 5.0, "answered")
    assert station.mission_ack == common.MAV_MISSION_ERROR


def test_telemetry_goes_on_while_parameters_cannot_be_stored(
    vehicle: BrokenVehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        raise ValueError("a parameter")

    storage = vehicle.tester.autopilot.parameter_storage
    serving = [
        (name, fail if serve == storage.serve_requests else serve)
        for name, serve in vehicle.tester.autopilot._serving
    ]
    monkeypatch.setattr(vehicle.tester.autopilot, "_serving", tuple(serving))
    vehicle.tester.run_for(2.0)
    assert "Internal error in parameter_storage" in vehicle.tester.ground_station.texts


def test_without_sensors_and_motors_the_program_ends(vehicle: BrokenVehicle) -> None:
    vehicle.broken.add("vehicle_io")
    with pytest.raises(ZeroDivisionError):
        vehicle.tester.run_for(0.1)


def test_a_stored_mission_whose_check_fails_cannot_be_flown() -> None:
    def fail(_items: object) -> PlanReview:
        yield 1
        raise ValueError("a check")

    review = MissionReview()
    with pytest.raises(ValueError, match="a check"):
        review.update((), "home has moved", fail)
    assert review.rejection is NOT_CHECKED
    assert review.update((), "home has moved", fail) == ""
    assert review.rejection is NOT_CHECKED
