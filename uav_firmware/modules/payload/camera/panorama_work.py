"""Leads camera and gimbal through a panorama, and reports on it."""

from typing import Final, NamedTuple

from uav_firmware.modules.payload.camera.panorama import Phase
from uav_firmware.modules.payload.camera.states import CameraState
from uav_firmware.modules.payload.parts import PanoramaWork, Parts
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.status import CommandResult, NavigationState, VehicleCommand

CANCELLED: Final = 6
"""MAV_RESULT_CANCELLED, newer than the results of other commands."""
TELL_US: Final = 500_000
"""[us] Progress is reported at least so often."""


class Report(NamedTuple):
    """Answer to the command that asked for the panorama."""

    command: VehicleCommand
    result: int  # [-] MAV_RESULT
    progress: int  # [%]
    reason: str = ""


class PanoramaStep(NamedTuple):
    """What a step has brought."""

    exposed: bool = False  # A picture is taken now
    report: Report | None = None


def step(parts: Parts, situation: Situation) -> PanoramaStep:
    """Go on with the panorama, if there is one."""
    work = parts.panorama
    if work is None:
        return PanoramaStep()
    hindrance = _hindrance(parts, situation)
    if hindrance is not None:
        reason = f"Panorama ended: {hindrance}"
        return PanoramaStep(report=_end(parts, work, CommandResult.FAILED, reason))
    panorama, exposed = work.panorama, False
    phase = panorama.phase(situation.now_us, settled=parts.gimbal.settled)
    if phase is Phase.SHOOTING and parts.camera.expose_in_panorama(situation.now_us):
        exposed = True
        panorama.note_picture()
        if panorama.phase(situation.now_us, settled=False) is Phase.DONE:
            return PanoramaStep(exposed, _end(parts, work, CommandResult.ACCEPTED))
        parts.gimbal.follow(panorama.aim)
    if not exposed and situation.now_us - work.told_us < TELL_US:
        return PanoramaStep()
    work.told_us = situation.now_us
    return PanoramaStep(exposed, Report(work.command, CommandResult.IN_PROGRESS, panorama.progress))


def _hindrance(parts: Parts, situation: Situation) -> str | None:
    """Why a panorama cannot go on, or None."""
    if situation.state is not NavigationState.AUTO_LOITER:
        return "the vehicle moves"
    if parts.camera.state is not CameraState.PANORAMA:
        return "capture was stopped"
    return None if parts.has_room else "the storage is full"


def cancel(parts: Parts, token: int) -> Report | None:
    """Break off the panorama that a command has asked for."""
    work = parts.panorama
    if work is None or work.command.token != token:
        return None
    return _end(parts, work, CANCELLED)


def _end(parts: Parts, work: PanoramaWork, result: int, reason: str = "") -> Report:
    """Let camera and gimbal go; the gimbal turns back to where it looked."""
    parts.panorama = None
    if parts.camera.state is CameraState.PANORAMA:
        parts.camera.stop()
    parts.gimbal.follow(work.former_aim)
    return Report(work.command, result, work.panorama.progress, reason)
