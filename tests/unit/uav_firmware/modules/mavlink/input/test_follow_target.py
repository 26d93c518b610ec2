"""Reports of a target become a topic, unless they cannot be true."""

import math
from typing import Any

import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import Bench
from uav_firmware.modules.mavlink.wire.dialect import mavlink


def report(
    capabilities: int = 3, latitude: float = 40.4, altitude: float = 650.0, north: float = 2.0
) -> Any:
    return mavlink.MAVLink_follow_target_message(
        timestamp=1,
        est_capabilities=capabilities,
        lat=round(latitude * 1e7),
        lon=-37_000_000,
        alt=altitude,
        vel=[north, -1.0, 0.5],
        acc=[0.0] * 3,
        attitude_q=[1.0, 0.0, 0.0, 0.0],
        rates=[0.0] * 3,
        position_cov=[1.5, 0.0, 0.0],
        custom_state=0,
    )


def test_position_and_velocity_are_told_on() -> None:
    bench = Bench()
    bench.say(report())
    bench.run()
    target = bench.topics.follow_target.value
    assert target is not None
    assert target.latitude_deg == pytest.approx(40.4)
    assert target.longitude_deg == pytest.approx(-3.7)
    assert target.altitude_amsl_m == 650.0
    assert target.velocity_ned == (2.0, -1.0, 0.5)
    assert target.accuracy_m == 1.5
    assert target.system_id == 255


def test_what_is_not_reported_is_unset() -> None:
    bench = Bench()
    bench.say(report(capabilities=1))
    bench.run()
    target = bench.topics.follow_target.value
    assert target is not None
    assert all(map(math.isnan, target.velocity_ned))
    bench.say(report(capabilities=2))
    bench.run()
    target = bench.topics.follow_target.value
    assert target is not None
    assert math.isnan(target.latitude_deg)


@pytest.mark.parametrize(
    "message",
    [
        report(latitude=95.0),
        report(altitude=math.nan),
        report(altitude=math.inf),
        report(north=math.nan),
        report(north=1e9),
    ],
)
def test_what_cannot_be_true_is_ignored(message: Any) -> None:
    bench = Bench()
    bench.say(message)
    bench.run()
    assert bench.topics.follow_target.value is None
