"""Executes a panorama with camera and gimbal and reports its progress."""

from typing import Final, NamedTuple

from uav_firmware.modules.payload.camera.panorama import Phase
from uav_firmware.modules.payload.camera.states import CameraState
from uav_firmware.modules.payload.parts import PanoramaWork, Parts
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.status import CommandResult, VehicleCommand

PROGRESS_INTERVAL_US: Final = 500_000
"""[us] Longest interval between progress reports."""


class Report(NamedTuple):
    """Acknowledgement of the command that started the panorama."""

    command: VehicleCommand
    result: int  # [-] MAV_RESULT
    progress: int  # [%]
    reason: str = ""


class PanoramaStep(NamedTuple):
    """Result of a step."""

    exposed: bool = False  # A picture is taken in this step
    report: Report | None = None


def step(parts: Parts, situation: Situation) -> PanoramaStep:
    """Continue the panorama if one is in progress."""
    work = parts.panorama
    if work is None:
        return PanoramaStep()
    work.has_rested |= situation.holds
    failure = _failure_reason(parts, work, situation)
    if failure is not None:
        reason = f"Panorama ended: {failure}"
        return PanoramaStep(report=_end(parts, work, CommandResult.FAILED, reason))
    panorama, exposed = work.panorama, False
    phase = panorama.phase(situation.now_us, settled=parts.gimbal.settled and work.has_rested)
    if phase is Phase.SHOOTING and parts.camera.expose_in_panorama(situation.now_us):
        exposed = True
        panorama.note_picture()
        if panorama.phase(situation.now_us, settled=False) is Phase.DONE:
            return PanoramaStep(exposed, _end(parts, work, CommandResult.ACCEPTED))
        parts.gimbal.follow(panorama.aim)
    if not exposed and situation.now_us - work.reported_us < PROGRESS_INTERVAL_US:
        return PanoramaStep()
    work.reported_us = situation.now_us
    return PanoramaStep(exposed, Report(work.command, CommandResult.IN_PROGRESS, panorama.progress))


def _failure_reason(parts: Parts, work: PanoramaWork, situation: Situation) -> str | None:
    """Why the panorama cannot continue, or None; it begins when the vehicle has come to rest."""
    rests = situation.holds if work.has_rested else situation.comes_to_rest
    if not rests:
        return "the vehicle moves"
    if parts.camera.state is not CameraState.PANORAMA:
        return "capture was stopped"
    return None if parts.has_space else "the storage is full"


def cancel(parts: Parts, token: int) -> Report | None:
    """Cancel the panorama that the command with this token started."""
    work = parts.panorama
    if work is None or work.command.token != token:
        return None
    return _end(parts, work, CommandResult.CANCELLED)


def _end(parts: Parts, work: PanoramaWork, result: int, reason: str = "") -> Report:
    """End the panorama and restore the previous aim of the gimbal."""
    parts.panorama = None
    if parts.camera.state is CameraState.PANORAMA:
        parts.camera.stop()
    parts.gimbal.follow(work.previous_aim)
    return Report(work.command, result, work.panorama.progress, reason)
