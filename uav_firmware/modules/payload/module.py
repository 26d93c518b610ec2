"""Connects camera and gimbal to the bus: orders and vehicle state in, answers and status out."""

import math
from typing import Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.cal.camera import CameraDevice, Recorder, Seeker, Streamer
from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.rotation import yaw_of
from uav_firmware.modules.payload import gimbal_orders, panorama_work
from uav_firmware.modules.payload.camera.lens import lens
from uav_firmware.modules.payload.camera.storage import Storage
from uav_firmware.modules.payload.camera.tracking import View, aim_at
from uav_firmware.modules.payload.orders import FlightEnd, MissionOrders, execute
from uav_firmware.modules.payload.panorama_work import Report
from uav_firmware.modules.payload.params import PayloadParams
from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.pictures import Pictures
from uav_firmware.modules.payload.reports import camera_status, gimbal_status, tracking_state
from uav_firmware.modules.payload.situation import NOWHERE, Situation
from uav_firmware.modules.payload.video import LiveView, VideoRecording
from uav_firmware.msg.estimate import VehicleAttitude, VehicleLocalPosition
from uav_firmware.msg.guidance import RegionOfInterest
from uav_firmware.msg.payload import (
    CameraEvent,
    CameraLens,
    CameraStatus,
    CancelOrder,
    Controller,
    GimbalOrder,
    GimbalStatus,
    PayloadOrder,
    TrackingState,
)
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import (
    PROGRESS_UNKNOWN,
    CommandResult,
    HomePosition,
    NavigationState,
    Severity,
    StatusText,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)
from uav_firmware.msg.vectors import Quaternion
from uav_firmware.parameters import Registry

PERIOD_US: Final = 40_000  # [us] 25 Hz
_AUTOPILOT: Final = 1  # Component id of the mission's orders
_LEVEL: Final[Quaternion] = (1.0, 0.0, 0.0, 0.0)


class PayloadModule:
    """Camera and gimbal of the vehicle; declares `PayloadParams` in the registry."""

    def __init__(
        self,
        registry: Registry,
        *,
        system_id: int,
        boot_time_utc_us: int,
        orders: Queue[PayloadOrder],
        region_of_interest: Topic[RegionOfInterest],
        attitude: Topic[VehicleAttitude],
        local_position: Topic[VehicleLocalPosition],
        home: Topic[HomePosition],
        vehicle_status: Topic[VehicleStatus],
        trajectory_setpoint: Topic[TrajectorySetpoint],
        command_ack: Queue[VehicleCommandAck],
        status_text: Queue[StatusText],
        camera_event: Queue[CameraEvent],
        camera_status: Topic[CameraStatus],
        camera_lens: Topic[CameraLens],
        gimbal_status: Topic[GimbalStatus],
        tracking_state: Topic[TrackingState],
        device: CameraDevice | None = None,
        recorder: Recorder | None = None,
        seeker: Seeker | None = None,
        streamer: Streamer | None = None,
        images_url: str = "",
    ) -> None:
        registry.add(PayloadParams)
        self._registry = registry
        self._params_version: int | None = None
        self._own = Controller(system_id, _AUTOPILOT)
        self._orders = orders
        self._region = region_of_interest
        self._region_count = 0
        self._attitude = attitude
        self._local_position = local_position
        self._home = home
        self._vehicle_status = vehicle_status
        self._trajectory_setpoint = trajectory_setpoint
        self._command_ack = command_ack
        self._status_text = status_text
        self._camera_event = camera_event
        self._camera_status = camera_status
        self._camera_lens = camera_lens
        self._gimbal_status = gimbal_status
        self._tracking_state = tracking_state
        self._frame: LocalFrame | None = None
        self._origin = NOWHERE
        params = registry.read(PayloadParams)
        self._parts = Parts(
            params, Storage(params.storage_mib), seeker=seeker, images_url=images_url
        )
        self._pictures = Pictures(self._parts, device, boot_time_utc_us, self._publish_warning)
        self._video = VideoRecording(self._parts, recorder, boot_time_utc_us, self._publish_info)
        self._live_view = LiveView(self._parts, streamer, boot_time_utc_us, self._publish_warning)
        self._mission_orders = MissionOrders()
        self._flight_end = FlightEnd()
        self._last_us: int | None = None

    def update(self, now_us: int) -> None:
        """Run a step."""
        elapsed_us = PERIOD_US if self._last_us is None else now_us - self._last_us
        if elapsed_us <= 0:
            return
        self._last_us = now_us
        self._read_params()
        situation = self._situation(now_us)
        attitude = self._attitude.value
        self._parts.q_ned_frd = _LEVEL if attitude is None else attitude.q_ned_frd
        self._handle_orders(situation)
        self._move(situation, elapsed_us * 1e-6)
        self._take_pictures(situation)
        self._publish(situation)

    def _read_params(self) -> None:
        if self._params_version == self._registry.version:
            return
        self._params_version = self._registry.version
        self._parts.params = params = self._registry.read(PayloadParams)
        self._camera_lens.publish(lens(params.image_width_px))

    def _situation(self, now_us: int) -> Situation:
        attitude, local = self._attitude.value, self._local_position.value
        status = self._vehicle_status.value
        known = local is not None and local.position_valid and local.altitude_valid
        if local is not None and known:
            origin = local.origin
            if self._frame is None or origin != self._origin:
                self._origin, self._frame = origin, LocalFrame(*origin)
        return Situation(
            now_us,
            self._own,
            yaw_of(attitude.q_ned_frd) if attitude is not None else 0.0,
            local.position_ned if local is not None and known else None,
            self._frame if known else None,
            self._home.value,
            status.navigation_state if status is not None else NavigationState.AUTO_LOITER,
            status is not None and status.armed,
            self._trajectory_setpoint.value,
        )

    def _handle_orders(self, situation: Situation) -> None:
        if self._region.count != self._region_count and self._region.value is not None:
            self._region_count = self._region.count
            gimbal_orders.take_region(self._region.value, self._parts, situation)
        text = self._flight_end.update(self._parts, situation)
        if text is not None:
            self._publish_text(situation.now_us, Severity.INFO, text)
        for order in self._orders.drain():
            match order:
                case GimbalOrder():
                    gimbal_orders.take_stream(order, self._parts)
                case CancelOrder():
                    self._report(panorama_work.cancel(self._parts, order.token), situation.now_us)
                case VehicleCommand(token=0):
                    self._parts.mission_orders.append(order)
                case VehicleCommand():
                    self._answer(order, situation)
        for refusal in self._mission_orders.update(self._parts, situation):
            self._publish_text(situation.now_us, Severity.WARNING, f"Mission: {refusal.reason}")

    def _answer(self, command: VehicleCommand, situation: Situation) -> None:
        outcome = execute(command, self._parts, situation)
        progress = 0 if outcome.result is CommandResult.IN_PROGRESS else PROGRESS_UNKNOWN
        self._report(Report(command, outcome.result, progress, outcome.reason), situation.now_us)

    def _report(self, report: Report | None, now_us: int) -> None:
        if report is None:
            return
        if report.reason:
            self._publish_text(now_us, Severity.WARNING, report.reason)
        self._command_ack.publish(
            VehicleCommandAck(
                now_us,
                report.command.command,
                report.result,
                report.progress,
                report.command.token,
            )
        )

    def _move(self, situation: Situation, dt: float) -> None:
        parts = self._parts
        rate = math.radians(parts.params.gimbal_rate_max_deg)
        parts.gimbal.update(situation.heading, situation.position_ned, rate, dt)
        if parts.tracker.target is not None and situation.position_ned is not None:
            view = View(situation.position_ned, parts.gimbal.q_ned_camera)
            box = None if parts.seeker is None else parts.seeker.seen(parts.gaze)
            subject = parts.tracker.follow(view, box, dt)
            if subject is not None:
                parts.gimbal.follow(aim_at(subject))
            if parts.tracker.update(view, situation.now_us):
                parts.gimbal.hold()
                self._publish_text(situation.now_us, Severity.WARNING, "Target lost")

    def _take_pictures(self, situation: Situation) -> None:
        parts = self._parts
        if parts.erase_due:
            self._pictures.erase(situation.now_us)
        self._pictures.collect(situation.now_us)
        step = panorama_work.step(parts, situation)
        q_ned_frd = parts.q_ned_frd
        if step.exposed or parts.camera.update(
            situation.now_us, situation.position_ned, mission_flown=situation.mission_flown
        ):
            self._pictures.expose(situation, q_ned_frd)
        self._video.update(situation, q_ned_frd)
        self._live_view.update(situation, q_ned_frd)
        self._report(step.report, situation.now_us)

    def _publish_info(self, now_us: int, text: str) -> None:
        self._publish_text(now_us, Severity.INFO, text)

    def _publish_warning(self, now_us: int, text: str) -> None:
        self._publish_text(now_us, Severity.WARNING, text)

    def _publish_text(self, now_us: int, severity: Severity, text: str) -> None:
        self._status_text.publish(StatusText(now_us, severity, text))

    def _publish(self, situation: Situation) -> None:
        now_us, parts = situation.now_us, self._parts
        for event in parts.events:
            self._camera_event.publish(event)
        parts.events.clear()
        status, old = camera_status(parts, now_us), self._camera_status.value
        if old is None or status[1:] != old[1:]:
            self._camera_status.publish(status)
        self._gimbal_status.publish(gimbal_status(parts, now_us))
        tracked = self._tracking_state.value
        if (
            tracked is None
            or parts.tracker.target is not None
            or parts.tracker.status is not tracked.status
        ):
            self._tracking_state.publish(tracking_state(parts, situation))
