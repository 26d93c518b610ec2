from sim.launch.console import mission_line, status_line


def test_a_vehicle_not_heard_is_said_to_be_so() -> None:
    assert status_line(3, None) == "vehicle 3  not connected"


def test_a_status_line_tells_mode_height_and_battery() -> None:
    line = status_line(
        1,
        {
            "link_state": "connected",
            "armed": True,
            "mode": "AUTO.MISSION",
            "altitude": 7.96,
            "battery_percentage": 0.934,
            "mission_id": 12,
        },
    )
    for part in ("connected", "armed", "AUTO.MISSION", "8.0 m", "93%", "mission 12"):
        assert part in line


def test_progress_counts_commands_that_ended_however_they_ended() -> None:
    commands = [{"command_status_id": status} for status in (3, 4, 5, 2, 1)]
    label, ended, total = mission_line(
        {"mission_id": 7, "vehicle_id": 2, "mission_status_id": 2, "command_array": commands}
    )
    assert (ended, total) == (3, 5)
    assert "7" in label
    assert "2" in label
