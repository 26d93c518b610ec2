"""Geometry of the picture, tracking by it, and panoramas."""

import itertools
import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.payload.harness import (
    LATITUDE_DEG,
    LONGITUDE_DEG,
    NAN,
    PayloadHarness,
)
from uav_firmware.cal.camera import Gaze, Seeker
from uav_firmware.lib.rotation import from_euler, yaw_of
from uav_firmware.modules.payload.camera.lens import in_picture, on_ground, ray_ned
from uav_firmware.modules.payload.camera.panorama import directions
from uav_firmware.msg.payload import Box, CancelOrder, PayloadCommand, TrackingMode, TrackingStatus
from uav_firmware.msg.status import CommandResult, NavigationState

POINT, RECTANGLE = PayloadCommand.CAMERA_TRACK_POINT, PayloadCommand.CAMERA_TRACK_RECTANGLE
STOP, PANORAMA = PayloadCommand.CAMERA_STOP_TRACKING, PayloadCommand.PANORAMA_CREATE
ACCEPTED, DENIED = CommandResult.ACCEPTED, CommandResult.DENIED
FAILED, BUSY = CommandResult.FAILED, CommandResult.TEMPORARILY_REJECTED
IN_PROGRESS, CANCELLED = CommandResult.IN_PROGRESS, CommandResult.CANCELLED
SHARE = st.floats(0.0, 1.0)


def test_picture_axes_when_looking_north() -> None:
    q = from_euler(0.0, math.radians(-45.0), 0.0)
    assert ray_ned(q, 0.8, 0.5)[1] > 0.0
    near = on_ground((0.0, 0.0, -10.0), ray_ned(q, 0.5, 0.9), 0.0)
    far = on_ground((0.0, 0.0, -10.0), ray_ned(q, 0.5, 0.1), 0.0)
    assert near is not None
    assert far is not None
    assert 0.0 < near[0] < 10.0 < far[0]


def test_above_the_horizon_there_is_no_ground() -> None:
    level = from_euler(0.0, 0.0, 0.0)
    assert on_ground((0.0, 0.0, -10.0), ray_ned(level, 0.5, 0.4), 0.0) is None
    assert on_ground((0.0, 0.0, 1.0), ray_ned(level, 0.5, 0.6), 0.0) is None


@given(SHARE, SHARE, st.floats(-90.0, 30.0), st.floats(-180.0, 180.0))
def test_projection_inverts_the_ray(x: float, y: float, pitch: float, yaw: float) -> None:
    camera = (3.0, -4.0, -20.0)
    q = from_euler(0.0, math.radians(pitch), math.radians(yaw))
    place = on_ground(camera, ray_ned(q, x, y), 0.0)
    assume(place is not None)
    assert place is not None
    seen = in_picture(camera, q, place)
    assert seen == pytest.approx((x, y), abs=1e-9)


def looking_down(pitch_deg: float = -45.0, seeker: Seeker | None = None) -> PayloadHarness:
    harness = PayloadHarness(seeker=seeker)
    harness.command(PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE, -2, -2, -1, -1)
    harness.command(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW, pitch_deg, 0, NAN, NAN)
    harness.run(2.0)
    return harness


class Eye:
    """Detects a subject that walks north at 1.5 m/s in the picture of the camera."""

    def __init__(self) -> None:
        self.harness: PayloadHarness
        self.is_hidden = False
        self.start_us = 0
        self.locks = 0

    def place(self) -> tuple[float, float, float]:
        return (12.0 + 1.5e-6 * (self.harness.now_us - self.start_us), 0.0, 0.0)

    def lock(self, box: Box, gaze: Gaze) -> bool:
        del box, gaze
        self.locks += 1
        self.start_us = self.harness.now_us
        return True

    def seen(self, gaze: Gaze) -> Box | None:
        at = in_picture(self.harness.position, gaze.q_ned_camera, self.place())
        if at is None or self.is_hidden:
            return None
        return Box(at[0] - 0.05, at[1] - 0.05, at[0] + 0.05, at[1] + 0.05)


def watching() -> tuple[PayloadHarness, Eye]:
    eye = Eye()
    eye.harness = harness = looking_down(seeker=eye)
    assert harness.command(RECTANGLE, 0.3, 0.3, 0.7, 0.7) == ACCEPTED
    return harness, eye


def test_a_moving_subject_is_tracked_and_its_velocity_reported() -> None:
    harness, eye = watching()
    harness.run(12.0)
    state = harness.tracked
    assert state.status is TrackingStatus.ACTIVE
    assert state.centre == pytest.approx((0.5, 0.5), abs=0.03)
    assert state.velocity_ned[0] == pytest.approx(1.5, abs=0.1)
    assert math.degrees(state.heading) == pytest.approx(0.0, abs=5.0)
    north_m = (state.latitude_deg - LATITUDE_DEG) * 111_040.0
    assert north_m == pytest.approx(eye.place()[0], abs=0.5)


def test_a_subject_hidden_briefly_is_tracked_again() -> None:
    harness, eye = watching()
    harness.run(8.0)
    eye.is_hidden = True
    harness.run(2.0)
    eye.is_hidden = False
    harness.run(2.0)
    assert harness.tracked.status is TrackingStatus.ACTIVE
    assert harness.tracked.centre == pytest.approx((0.5, 0.5), abs=0.05)


def test_a_subject_hidden_for_long_is_lost() -> None:
    harness, eye = watching()
    harness.run(4.0)
    eye.is_hidden = True
    harness.run(4.0)
    assert harness.tracked.status is TrackingStatus.ERROR
    assert "Target lost" in harness.status_texts()


def test_the_place_in_the_rectangle_is_centred() -> None:
    harness = looking_down()
    assert harness.command(RECTANGLE, 0.6, 0.6, 0.8, 0.8) == ACCEPTED
    harness.velocity = (1.0, 0.5, 0.0)
    harness.run(4.0)
    state = harness.tracked
    assert state.status is TrackingStatus.ACTIVE
    assert state.mode is TrackingMode.RECTANGLE
    assert state.centre == pytest.approx((0.5, 0.5), abs=0.05)
    assert state.latitude_deg > LATITUDE_DEG
    assert state.longitude_deg > LONGITUDE_DEG
    assert harness.command(STOP) == ACCEPTED
    assert harness.tracked.status is TrackingStatus.IDLE
    assert harness.tracked.mode is TrackingMode.NONE


def test_a_rectangle_grows_as_the_vehicle_approaches() -> None:
    harness = looking_down()
    harness.command(RECTANGLE, 0.4, 0.4, 0.6, 0.6)
    before = harness.tracked.extent[0]
    harness.velocity = (1.0, 0.0, 0.5)
    harness.run(4.0)
    assert harness.tracked.extent[0] > 1.1 * before


def test_a_point_is_tracked_with_its_radius() -> None:
    harness = looking_down()
    assert harness.command(POINT, 0.5, 0.5, 0.1) == ACCEPTED
    assert harness.tracked.mode is TrackingMode.POINT
    assert harness.tracked.extent[0] == pytest.approx(0.1, rel=0.05)


def test_the_sky_cannot_be_tracked() -> None:
    harness = PayloadHarness()
    harness.run(0.1)
    assert harness.command(POINT, 0.5, 0.3) == FAILED
    assert harness.tracked.status is TrackingStatus.IDLE


@pytest.mark.parametrize(
    "wrong", [(RECTANGLE, 0.5, 0.5, 0.4, 0.6), (RECTANGLE, 0, 0, 1.1, 1), (POINT, NAN, 0.5)]
)
def test_a_target_outside_the_picture_is_denied(wrong: tuple[float, ...]) -> None:
    harness = looking_down()
    assert harness.command(int(wrong[0]), *wrong[1:]) == DENIED


def test_a_lost_target_is_reported() -> None:
    harness = looking_down(-40.0)
    harness.registry.set("MNT_SLEW_MAX", 5.0)
    harness.command(POINT, 0.5, 0.5)
    harness.velocity = (20.0, 0.0, 0.0)
    harness.run(5.0)
    assert harness.tracked.status is TrackingStatus.ERROR
    assert "Target lost" in harness.status_texts()


def test_a_new_direction_ends_tracking() -> None:
    harness = looking_down()
    harness.command(POINT, 0.5, 0.5)
    harness.command(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW, -90, 0, NAN, NAN)
    assert harness.tracked.status is TrackingStatus.IDLE


@pytest.mark.parametrize(("angle", "shots"), [(360.0, 8), (180.0, 5), (90.0, 3), (45.0, 2)])
def test_number_of_pictures_of_a_panorama(angle: float, shots: int) -> None:
    assert len(directions(angle, 0.0, -0.2, 1.0)) == shots


def test_half_a_circle_spans_left_to_right() -> None:
    yaws = [math.degrees(yaw) for _, yaw in directions(180.0, 0.0, 0.0, 0.0)]
    assert yaws == pytest.approx([-90.0, -45.0, 0.0, 45.0, 90.0])


def test_a_panorama_from_straight_down_is_raised() -> None:
    for before_deg, seen_deg in ((-90.0, -10.0), (-30.0, -30.0), (15.0, 15.0)):
        found = directions(360.0, 0.0, math.radians(before_deg), 0.0)
        assert {round(math.degrees(pitch)) for pitch, _ in found} == {seen_deg}


def test_rows_beyond_the_range_are_refused() -> None:
    assert len(directions(90.0, 60.0, math.radians(-30.0), 0.0)) == 9
    with pytest.raises(ValueError, match="range"):
        directions(90.0, 60.0, 0.1, 0.0)


def test_a_full_circle_reports_progress_and_one_result() -> None:
    harness = PayloadHarness()
    harness.heading_deg = 20.0
    harness.run(0.1)
    token = harness.order(PANORAMA, 360.0)
    harness.run(30.0)
    yaws = sorted(math.degrees(yaw_of(p.q_ned_camera)) % 360.0 for p in harness.pictures())
    assert yaws == pytest.approx([20.0 + 45.0 * i for i in range(8)], abs=1.5)
    acks = [ack for ack in harness.acks.drain() if ack.token == token]
    assert [ack.result for ack in acks] == [IN_PROGRESS] * (len(acks) - 1) + [ACCEPTED]
    progress = [ack.progress for ack in acks[:-1]]
    assert progress == sorted(progress)
    times = [ack.time_us for ack in acks]
    assert max(b - a for a, b in itertools.pairwise(times)) <= 1_000_000
    assert harness.yaw_deg == pytest.approx(20.0, abs=1.5)


def test_a_panorama_turns_at_the_commanded_rate() -> None:
    harness = PayloadHarness()
    harness.run(0.1)
    harness.command(PANORAMA, 90.0, 0, 10.0)
    harness.run(5.0)
    assert len(harness.pictures()) == 1


@pytest.mark.parametrize(
    "wrong", [(0.0,), (400.0,), (NAN,), (90.0, 200.0), (90.0, 0, -5.0), (90.0, 0, 0, 0, 1.0)]
)
def test_invalid_panorama_angles_are_denied(wrong: tuple[float, ...]) -> None:
    assert PayloadHarness().command(PANORAMA, *wrong) == DENIED


def test_a_panorama_needs_hold_mode() -> None:
    harness = PayloadHarness()
    harness.flies(NavigationState.AUTO_MISSION)
    assert harness.command(PANORAMA, 360.0) == BUSY
    harness.flies(NavigationState.AUTO_LOITER)
    token = harness.order(PANORAMA, 360.0)
    harness.run(3.0)
    assert harness.command(PANORAMA, 360.0) == BUSY
    harness.acks.drain()
    harness.flies(NavigationState.AUTO_RTL)
    harness.run(1.0)
    (end,) = harness.acks.drain()
    assert (end.token, end.result) == (token, FAILED)


def test_a_panorama_is_refused_on_the_way_to_a_place() -> None:
    harness = PayloadHarness()
    harness.run(0.1)
    harness.leads((30.0, 0.0, -10.0), 0.0)  # It begins, or waits for a vehicle that lags behind
    assert harness.command(PANORAMA, 360.0) == BUSY
    assert "PANORAMA_CREATE refused: the vehicle moves" in harness.status_texts()


def test_a_panorama_of_a_vehicle_that_brakes_begins_when_it_rests() -> None:
    harness = PayloadHarness()
    harness.run(0.1)
    harness.leads((NAN, NAN, NAN), 3.0)
    harness.order(PANORAMA, 360.0)
    harness.run(5.0)
    assert {ack.progress for ack in harness.acks.drain()} == {0}
    harness.leads((NAN, NAN, NAN), 0.0)
    harness.run(5.0)
    assert max(ack.progress for ack in harness.acks.drain()) > 0


def test_a_flight_to_a_place_ends_a_panorama_and_a_gust_does_not() -> None:
    harness = PayloadHarness()
    harness.run(0.1)
    harness.leads((NAN, NAN, NAN), 0.0)
    token = harness.order(PANORAMA, 360.0)
    harness.velocity = (0.8, 0.0, 0.0)
    harness.run(1.0)
    assert {ack.result for ack in harness.acks.drain()} == {IN_PROGRESS}
    harness.leads((30.0, 0.0, -10.0), 0.0)
    harness.run(0.1)
    (end,) = harness.acks.drain()
    assert (end.token, end.result) == (token, FAILED)
    assert "Panorama ended: the vehicle moves" in harness.status_texts()


@pytest.mark.parametrize("how", ["stop", "cancel"])
def test_a_panorama_can_be_cancelled(how: str) -> None:
    harness = PayloadHarness()
    token = harness.order(PANORAMA, 360.0)
    harness.run(3.0)
    harness.acks.drain()
    if how == "stop":
        harness.command(PayloadCommand.IMAGE_STOP_CAPTURE)
        harness.run(0.1)
    else:
        harness.orders.publish(CancelOrder(harness.now_us, token))
        harness.run(0.1)
        (end,) = harness.acks.drain()
        assert (end.token, end.result) == (token, CANCELLED)
    harness.pictures()
    harness.run(5.0)
    assert harness.pictures() == []
    assert harness.command(PayloadCommand.IMAGE_START_CAPTURE, 0, 0, 1) == ACCEPTED
