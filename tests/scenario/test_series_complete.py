"""A counted series is complete before the next command begins, whatever that is."""

from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from tests.support.flying_world import FlyingWorld

pytestmark = pytest.mark.scenario


HOME = (40.4434, -3.7382)


def plan(behind: dict[str, Any], count: int) -> dict[str, Any]:
    commands = [
        (1, {"latitude": HOME[0], "longitude": HOME[1], "altitude": 5.0}),
        (4, {"pitch_angle": -30, "yaw_angle": 180, "photo_count": count, "time_interval": 2}),
        (behind["command_type_id"], behind["parameters"]),
        (11, {"landing": True}),
    ]
    return {
        "mission_id": 1,
        "vehicle_id": 1,
        "maximum_speed": 4.0,
        "command_array": [
            {"command_id": number, "command_type_id": kind, "parameters": parameters}
            for number, (kind, parameters) in enumerate(commands, 1)
        ],
    }


@pytest.mark.parametrize(
    ("behind", "count", "pictures"),
    [
        ({"command_type_id": 10, "parameters": {"panorama_mode": 0}}, 2, 2 + 8),
        (
            {
                "command_type_id": 7,
                "parameters": {
                    "latitude": 40.44355,
                    "longitude": -3.738,
                    "orbit_altitude": 6,
                    "radius": 6,
                    "angular_velocity": 30,
                    "start_point": 2,
                    "orbit_type": 2,
                },
            },
            3,
            3,
        ),
    ],
    ids=["panorama", "hotpoint"],
)
def test_before_a_live_command(
    tmp_path: Path, behind: dict[str, Any], count: int, pictures: int
) -> None:
    world = FlyingWorld(tmp_path)
    flown = plan(behind, count)
    world.edge.plan(flown)
    world.run_until_over(1)
    report = world.edge.reports(1)[-1]
    assert world.edge.statuses(1) == [Status.FINISHED] * 4, report
    assert world.pictures == pictures
