"""Geometry of the picture, tracking by it, and panoramas."""

import itertools
import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.payload.bench import (
    LATITUDE_DEG,
    LONGITUDE_DEG,
    NAN,
    Bench,
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
IN_PROGRESS, CANCELLED = CommandResult.IN_PROGRESS, 6
SHARE = st.floats(0.0, 1.0)


def test_right_in_the_picture_is_east_and_low_is_near_when_looking_north() -> None:
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
def test_what_is_seen_at_a_point_appears_at_that_point(
    x: float, y: float, pitch: float, yaw: float
) -> None:
    camera = (3.0, -4.0, -20.0)
    q = from_euler(0.0, math.radians(pitch), math.radians(yaw))
    place = on_ground(camera, ray_ned(q, x, y), 0.0)
    assume(place is not None)
    assert place is not None
    seen = in_picture(camera, q, place)
    assert seen == pytest.approx((x, y), abs=1e-9)


def looking_down(pitch_deg: float = -45.0, seeker: Seeker | None = None) -> Bench:
    bench = Bench(seeker=seeker)
    bench.ask(PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE, -2, -2, -1, -1)
    bench.ask(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW, pitch_deg, 0, NAN, NAN)
    bench.run(2.0)
    return bench


class Eye:
    """Sees a subject that walks north at 1.5 m/s, in the picture that the bench's camera takes."""

    def __init__(self) -> None:
        self.bench: Bench
        self.is_hidden = False
        self.start_us = 0
        self.locks = 0

    def place(self) -> tuple[float, float, float]:
        return (12.0 + 1.5e-6 * (self.bench.now_us - self.start_us), 0.0, 0.0)

    def lock(self, box: Box, gaze: Gaze) -> bool:
        del box, gaze
        self.locks += 1
        self.start_us = self.bench.now_us
        return True

    def seen(self, gaze: Gaze) -> Box | None:
        at = in_picture(self.bench.position, gaze.q_ned_camera, self.place())
        if at is None or self.is_hidden:
            return None
        return Box(at[0] - 0.05, at[1] - 0.05, at[0] + 0.05, at[1] + 0.05)


def watching() -> tuple[Bench, Eye]:
    eye = Eye()
    eye.bench = bench = looking_down(seeker=eye)
    assert bench.ask(RECTANGLE, 0.3, 0.3, 0.7, 0.7) == ACCEPTED
    return bench, eye


def test_a_subject_is_followed_on_its_way_and_its_speed_is_told() -> None:
    bench, eye = watching()
    bench.run(12.0)
    state = bench.tracked
    assert state.status is TrackingStatus.ACTIVE
    assert state.centre == pytest.approx((0.5, 0.5), abs=0.03)
    assert state.velocity_ned[0] == pytest.approx(1.5, abs=0.1)
    assert math.degrees(state.heading) == pytest.approx(0.0, abs=5.0)
    north_m = (state.latitude_deg - LATITUDE_DEG) * 111_040.0
    assert north_m == pytest.approx(eye.place()[0], abs=0.5)


def test_a_subject_that_hides_for_a_moment_is_found_again_where_it_went() -> None:
    bench, eye = watching()
    bench.run(8.0)
    eye.is_hidden = True
    bench.run(2.0)
    eye.is_hidden = False
    bench.run(2.0)
    assert bench.tracked.status is TrackingStatus.ACTIVE
    assert bench.tracked.centre == pytest.approx((0.5, 0.5), abs=0.05)


def test_a_subject_that_stays_away_is_lost() -> None:
    bench, eye = watching()
    bench.run(4.0)
    eye.is_hidden = True
    bench.run(4.0)
    assert bench.tracked.status is TrackingStatus.ERROR
    assert "Target lost" in bench.said()


def test_the_place_in_the_rectangle_comes_to_the_middle_and_stays_there() -> None:
    bench = looking_down()
    assert bench.ask(RECTANGLE, 0.6, 0.6, 0.8, 0.8) == ACCEPTED
    bench.velocity = (1.0, 0.5, 0.0)
    bench.run(4.0)
    state = bench.tracked
    assert state.status is TrackingStatus.ACTIVE
    assert state.mode is TrackingMode.RECTANGLE
    assert state.centre == pytest.approx((0.5, 0.5), abs=0.05)
    assert state.latitude_deg > LATITUDE_DEG
    assert state.longitude_deg > LONGITUDE_DEG
    assert bench.ask(STOP) == ACCEPTED
    assert bench.tracked.status is TrackingStatus.IDLE
    assert bench.tracked.mode is TrackingMode.NONE


def test_a_rectangle_grows_as_the_vehicle_comes_nearer() -> None:
    bench = looking_down()
    bench.ask(RECTANGLE, 0.4, 0.4, 0.6, 0.6)
    before = bench.tracked.extent[0]
    bench.velocity = (1.0, 0.0, 0.5)
    bench.run(4.0)
    assert bench.tracked.extent[0] > 1.1 * before


def test_a_point_is_tracked_with_its_radius() -> None:
    bench = looking_down()
    assert bench.ask(POINT, 0.5, 0.5, 0.1) == ACCEPTED
    assert bench.tracked.mode is TrackingMode.POINT
    assert bench.tracked.extent[0] == pytest.approx(0.1, rel=0.05)


def test_the_sky_cannot_be_tracked() -> None:
    bench = Bench()
    bench.run(0.1)
    assert bench.ask(POINT, 0.5, 0.3) == FAILED
    assert bench.tracked.status is TrackingStatus.IDLE


@pytest.mark.parametrize(
    "wrong", [(RECTANGLE, 0.5, 0.5, 0.4, 0.6), (RECTANGLE, 0, 0, 1.1, 1), (POINT, NAN, 0.5)]
)
def test_a_target_outside_the_picture_is_denied(wrong: tuple[float, ...]) -> None:
    bench = looking_down()
    assert bench.ask(int(wrong[0]), *wrong[1:]) == DENIED


def test_a_target_that_is_left_behind_is_lost_in_words() -> None:
    bench = looking_down(-40.0)
    bench.registry.set("MNT_SLEW_MAX", 5.0)
    bench.ask(POINT, 0.5, 0.5)
    bench.velocity = (20.0, 0.0, 0.0)
    bench.run(5.0)
    assert bench.tracked.status is TrackingStatus.ERROR
    assert "Target lost" in bench.said()


def test_a_new_direction_ends_tracking() -> None:
    bench = looking_down()
    bench.ask(POINT, 0.5, 0.5)
    bench.ask(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW, -90, 0, NAN, NAN)
    assert bench.tracked.status is TrackingStatus.IDLE


@pytest.mark.parametrize(("angle", "shots"), [(360.0, 8), (180.0, 5), (90.0, 3), (45.0, 2)])
def test_a_panorama_has_dji_s_number_of_pictures(angle: float, shots: int) -> None:
    assert len(directions(angle, 0.0, -0.2, 1.0)) == shots


def test_half_a_circle_reaches_from_left_to_right() -> None:
    yaws = [math.degrees(yaw) for _, yaw in directions(180.0, 0.0, 0.0, 0.0)]
    assert yaws == pytest.approx([-90.0, -45.0, 0.0, 45.0, 90.0])


def test_after_pictures_straight_down_a_panorama_looks_round() -> None:
    for before_deg, seen_deg in ((-90.0, -10.0), (-30.0, -30.0), (15.0, 15.0)):
        found = directions(360.0, 0.0, math.radians(before_deg), 0.0)
        assert {round(math.degrees(pitch)) for pitch, _ in found} == {seen_deg}


def test_rows_beyond_the_range_are_refused() -> None:
    assert len(directions(90.0, 60.0, math.radians(-30.0), 0.0)) == 9
    with pytest.raises(ValueError, match="range"):
        directions(90.0, 60.0, 0.1, 0.0)


def test_a_full_circle_is_taken_with_progress_and_one_end() -> None:
    bench = Bench()
    bench.heading_deg = 20.0
    bench.run(0.1)
    token = bench.order(PANORAMA, 360.0)
    bench.run(30.0)
    yaws = sorted(math.degrees(yaw_of(p.q_ned_camera)) % 360.0 for p in bench.pictures())
    assert yaws == pytest.approx([20.0 + 45.0 * i for i in range(8)], abs=1.5)
    acks = [ack for ack in bench.acks.drain() if ack.token == token]
    assert [ack.result for ack in acks] == [IN_PROGRESS] * (len(acks) - 1) + [ACCEPTED]
    progress = [ack.progress for ack in acks[:-1]]
    assert progress == sorted(progress)
    times = [ack.time_us for ack in acks]
    assert max(b - a for a, b in itertools.pairwise(times)) <= 1_000_000
    assert bench.yaw_deg == pytest.approx(20.0, abs=1.5)


def test_a_slow_panorama_is_slow() -> None:
    bench = Bench()
    bench.run(0.1)
    bench.ask(PANORAMA, 90.0, 0, 10.0)
    bench.run(5.0)
    assert len(bench.pictures()) == 1


@pytest.mark.parametrize(
    "wrong", [(0.0,), (400.0,), (NAN,), (90.0, 200.0), (90.0, 0, -5.0), (90.0, 0, 0, 0, 1.0)]
)
def test_a_panorama_of_no_angle_is_denied(wrong: tuple[float, ...]) -> None:
    assert Bench().ask(PANORAMA, *wrong) == DENIED


def test_a_panorama_needs_a_vehicle_in_hold_and_fails_when_it_leaves() -> None:
    bench = Bench()
    bench.flies(NavigationState.AUTO_MISSION)
    assert bench.ask(PANORAMA, 360.0) == BUSY
    bench.flies(NavigationState.AUTO_LOITER)
    token = bench.order(PANORAMA, 360.0)
    bench.run(3.0)
    assert bench.ask(PANORAMA, 360.0) == BUSY
    bench.acks.drain()
    bench.flies(NavigationState.AUTO_RTL)
    bench.run(1.0)
    (end,) = bench.acks.drain()
    assert (end.token, end.result) == (token, FAILED)


@pytest.mark.parametrize("how", ["stop", "cancel"])
def test_a_panorama_can_be_broken_off(how: str) -> None:
    bench = Bench()
    token = bench.order(PANORAMA, 360.0)
    bench.run(3.0)
    bench.acks.drain()
    if how == "stop":
        bench.ask(PayloadCommand.IMAGE_STOP_CAPTURE)
        bench.run(0.1)
    else:
        bench.orders.publish(CancelOrder(bench.now_us, token))
        bench.run(0.1)
        (end,) = bench.acks.drain()
        assert (end.token, end.result) == (token, CANCELLED)
    bench.pictures()
    bench.run(5.0)
    assert bench.pictures() == []
    assert bench.ask(PayloadCommand.IMAGE_START_CAPTURE, 0, 0, 1) == ACCEPTED
