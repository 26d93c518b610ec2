"""The receiver: late, honest about its accuracy, east is east."""

import itertools
import statistics
from typing import Any

import pytest

from sim.gnss_receivers import GNSS_RECEIVERS
from sim.physics.noise import generators
from sim.sensors.gps import DELAY_US, FIRST_FIX_US, RATE_HZ, Gps
from sim.sensors.readings import GpsReading
from tests.unit.sim.truths import truth

START_UTC_US = 1_780_300_800_000_000
METRES_PER_DEGREE_NORTH = 111_045.0
METRES_PER_DEGREE_EAST = 84_843.0


def gps(*, seed: int = 1, factor: float = 1.0, receiver: str = "m9n") -> Gps:
    return Gps(
        generators(seed)["gps"],
        GNSS_RECEIVERS[receiver],
        factor=factor,
        start_time_utc_us=START_UTC_US,
    )


def solution(instrument: Gps, time_us: int = FIRST_FIX_US, **changes: Any) -> GpsReading:
    instrument.measure(truth(time_us, **changes))
    reading = instrument.deliver(time_us + DELAY_US)
    assert reading is not None
    return reading


def test_a_solution_arrives_120_ms_after_the_instant_it_is_valid_for() -> None:
    receiver = gps()
    receiver.measure(truth(FIRST_FIX_US))
    assert receiver.deliver(FIRST_FIX_US) is None
    assert receiver.deliver(FIRST_FIX_US + 116_000) is None
    reading = receiver.deliver(FIRST_FIX_US + 120_000)
    assert reading is not None
    assert reading.time_us == FIRST_FIX_US
    assert receiver.deliver(FIRST_FIX_US + 124_000) is None


def test_solutions_on_their_way_arrive_in_order() -> None:
    receiver = gps()
    for index in range(2):
        receiver.measure(truth(FIRST_FIX_US + index * 100_000))
    arrived = [receiver.deliver(FIRST_FIX_US + 300_000) for _ in range(3)]
    assert [reading and reading.time_us for reading in arrived] == [
        FIRST_FIX_US,
        FIRST_FIX_US + 100_000,
        None,
    ]


def test_it_is_the_position_of_then_and_not_of_now() -> None:
    receiver = gps(factor=0.0)
    receiver.measure(truth(FIRST_FIX_US, latitude_deg=40.0))
    receiver.measure(truth(FIRST_FIX_US + 100_000, latitude_deg=41.0))
    reading = receiver.deliver(FIRST_FIX_US + DELAY_US)
    assert reading is not None
    assert reading.latitude_deg == 40.0


def test_an_ideal_receiver_gives_the_truth() -> None:
    reading = solution(gps(factor=0.0), velocity_ned=(1.0, -2.0, 3.0))
    state = truth()
    assert (reading.latitude_deg, reading.longitude_deg) == (
        state.latitude_deg,
        state.longitude_deg,
    )
    assert reading.altitude_amsl_m == state.altitude_amsl_m
    assert reading.velocity_ned == (1.0, -2.0, 3.0)


def test_it_has_no_fix_at_first_and_then_a_good_one() -> None:
    receiver = gps()
    cold, warm = solution(receiver, 0), solution(receiver, FIRST_FIX_US)
    assert (cold.fix_type, cold.satellites_used, cold.time_utc_us) == (1, 0, 0)
    assert warm.fix_type == 3
    assert warm.satellites_used > 10


def test_utc_runs_with_simulated_time() -> None:
    assert solution(gps(), FIRST_FIX_US).time_utc_us == START_UTC_US + FIRST_FIX_US


def errors_m(instrument: Gps, count: int) -> list[tuple[float, float, float]]:
    state = truth()
    errors = []
    for index in range(count):
        reading = solution(instrument, FIRST_FIX_US + index * 1_000_000 // RATE_HZ)
        errors.append(
            (
                (reading.latitude_deg - state.latitude_deg) * METRES_PER_DEGREE_NORTH,
                (reading.longitude_deg - state.longitude_deg) * METRES_PER_DEGREE_EAST,
                state.altitude_amsl_m - reading.altitude_amsl_m,
            )
        )
    return errors


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("receiver", "horizontal_m", "down_m"), [("m9n", 1.4, 1.8), ("rtk", 0.026, 0.03)]
)
def test_its_errors_are_as_large_as_it_says_and_as_its_class_has(
    receiver: str, horizontal_m: float, down_m: float
) -> None:
    squares = [(0.0, 0.0)]
    for seed in range(400):  # One fix of each: a day of one receiver holds few independent errors
        north, east, down = errors_m(gps(seed=seed, receiver=receiver), 1)[0]
        squares.append((north * north + east * east, down * down))
    horizontal, vertical = (statistics.fmean(axis) ** 0.5 for axis in zip(*squares, strict=True))
    reading = solution(gps(receiver=receiver))
    assert horizontal == pytest.approx(reading.horizontal_accuracy_m, rel=0.1)
    assert vertical == pytest.approx(reading.vertical_accuracy_m, rel=0.1)
    assert horizontal == pytest.approx(horizontal_m, rel=0.15)
    assert vertical == pytest.approx(down_m, rel=0.15)


@pytest.mark.parametrize(("receiver", "fix_type"), [("m9n", 3), ("rtk", 6)])
def test_it_says_which_kind_of_solution_it_has(receiver: str, fix_type: int) -> None:
    assert solution(gps(receiver=receiver)).fix_type == fix_type


@pytest.mark.thorough
def test_within_a_minute_a_single_band_receiver_is_wrong_by_much_the_same() -> None:
    changes = []
    for seed in range(100):
        track = errors_m(gps(seed=seed), 601)
        changes.append((track[600][0] - track[0][0]) ** 2)
    # 2 s^2 (1 - exp(-t / T)) of both processes: 0.38 m and 0.53 m
    assert statistics.fmean(changes) ** 0.5 == pytest.approx(0.66, rel=0.2)


def test_the_same_error_is_more_degrees_of_longitude_nearer_to_the_pole() -> None:
    north, east = [], []
    for latitude_deg in (0.0, 60.0):
        reading = solution(gps(), latitude_deg=latitude_deg, longitude_deg=0.0)
        north.append(reading.latitude_deg - latitude_deg)
        east.append(reading.longitude_deg)
    assert north[1] == pytest.approx(north[0], rel=0.01)
    assert east[1] == pytest.approx(2.0 * east[0], rel=0.01)


def test_its_position_error_drifts_rather_than_jumps() -> None:
    north = [error[0] for error in errors_m(gps(), 3000)]
    jumps = statistics.pstdev(b - a for a, b in itertools.pairwise(north))
    assert jumps < 0.1


def test_its_velocity_errors_are_as_documented() -> None:
    receiver = gps()
    velocities = [
        solution(receiver, FIRST_FIX_US + index * 100_000).velocity_ned for index in range(5000)
    ]
    for axis, sigma in zip(zip(*velocities, strict=True), (0.05, 0.05, 0.08), strict=True):
        assert statistics.fmean(axis) == pytest.approx(0.0, abs=0.01)
        assert statistics.pstdev(axis) == pytest.approx(sigma, rel=0.05)


def test_an_ideal_receiver_does_not_claim_to_be_perfect() -> None:
    reading = solution(gps(factor=0.0))
    assert reading.horizontal_accuracy_m > 0.0
    assert reading.vertical_accuracy_m > 0.0
    assert reading.speed_accuracy_m_s > 0.0
