"""Parameters of camera and gimbal commands: any numbers are judged, unset ones are no wish."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.lib.payload_rules import fault_of
from uav_firmware.msg.payload import PayloadCommand

COMMANDS = st.sampled_from(PayloadCommand)
SEVEN = st.lists(st.floats(width=32), min_size=7, max_size=7)
NEEDS_SOMETHING = {
    PayloadCommand.SET_CAMERA_MODE: 2,
    PayloadCommand.CAMERA_TRACK_POINT: 1,
    PayloadCommand.CAMERA_TRACK_RECTANGLE: 1,
    PayloadCommand.PANORAMA_CREATE: 1,
    PayloadCommand.DO_MOUNT_CONTROL: 7,
}


@given(COMMANDS, SEVEN)
def test_any_numbers_are_judged_and_a_fault_names_its_parameter(
    command: PayloadCommand, parameters: list[float]
) -> None:
    fault = fault_of(command, parameters)
    if any(map(math.isinf, parameters)):
        assert fault is not None
    if fault is not None:
        assert 1 <= fault.parameter <= 7
        assert fault.reason


@pytest.mark.parametrize("command", PayloadCommand)
def test_what_is_all_unset_is_fine_unless_something_has_to_be_said(command: PayloadCommand) -> None:
    fault = fault_of(command, [math.nan] * 7)
    needed = NEEDS_SOMETHING.get(command)
    assert (None if fault is None else fault.parameter) == needed


@pytest.mark.parametrize("command", PayloadCommand)
def test_every_command_can_be_given_and_nothing_more_than_it_honours(
    command: PayloadCommand,
) -> None:
    good = {
        PayloadCommand.DO_DIGICAM_CONTROL: (0, 0, 0, 0, 1, 0, 0),
        PayloadCommand.DO_MOUNT_CONFIGURE: (2, 1, 1, 1, 0, 0, 0),
        PayloadCommand.DO_MOUNT_CONTROL: (-45, 0, 10, 0, 0, 0, 2),
        PayloadCommand.DO_SET_CAM_TRIGG_DIST: (25, 0, 1, 0, 0, 0, 0),
        PayloadCommand.STORAGE_FORMAT: (1, 1, 0, 0, 0, 0, 0),
        PayloadCommand.RESET_CAMERA_SETTINGS: (1, 100, 0, 0, 0, 0, 0),
        PayloadCommand.SET_CAMERA_MODE: (0, 2, 0, 0, 0, 0, 0),
        PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW: (-90, 0, math.nan, math.nan, 16, 0, 0),
        PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE: (-2, -2, -1, -1, 0, 0, 1),
        PayloadCommand.IMAGE_START_CAPTURE: (0, 2, 5, 0, 0, 0, 0),
        PayloadCommand.IMAGE_STOP_CAPTURE: (100, 0, 0, 0, 0, 0, 0),
        PayloadCommand.CAMERA_TRACK_POINT: (0.5, 0.5, 0.1, 0, 0, 0, 0),
        PayloadCommand.CAMERA_TRACK_RECTANGLE: (0.2, 0.2, 0.4, 0.4, 0, 0, 0),
        PayloadCommand.CAMERA_STOP_TRACKING: (0, 0, 0, 0, 0, 0, 0),
        PayloadCommand.VIDEO_START_CAPTURE: (0, 1, 0, 0, 0, 0, 0),
        PayloadCommand.VIDEO_STOP_CAPTURE: (1, 0, 0, 0, 0, 0, 0),
        PayloadCommand.VIDEO_START_STREAMING: (1, 0, 0, 0, 0, 0, 0),
        PayloadCommand.VIDEO_STOP_STREAMING: (1, 0, 0, 0, 0, 0, 0),
        PayloadCommand.PANORAMA_CREATE: (360, 0, 30, 0, 0, 0, 0),
    }[command]
    parameters = [float(value) for value in good]
    assert fault_of(command, parameters) is None
    spoilt = [*parameters[:5], math.inf, parameters[6]]
    fault = fault_of(command, spoilt)
    assert fault is not None
    assert fault.parameter == 6
