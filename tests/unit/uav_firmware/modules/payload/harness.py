"""A payload module on its own topics, with vehicle time under control."""

import math
from typing import Any

from uav_firmware.bus import Queue, Topic
from uav_firmware.cal.camera import CameraDevice, Recorder, Seeker, Streamer
from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.payload.module import PERIOD_US, PayloadModule
from uav_firmware.msg.estimate import VehicleAttitude, VehicleLocalPosition
from uav_firmware.msg.guidance import RegionOfInterest
from uav_firmware.msg.payload import (
    CameraEvent,
    CameraLens,
    CameraStatus,
    Controller,
    GimbalStatus,
    ImageCaptured,
    PayloadOrder,
    TrackingState,
)
from uav_firmware.msg.setpoints import TrajectorySetpoint
from uav_firmware.msg.status import (
    HomePosition,
    NavigationState,
    StatusText,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

SYSTEM = 7
OPERATOR = Controller(255, 190)
RIVAL = Controller(42, 191)
MISSION = Controller(0, 0)
LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_M = 40.4434, -3.7382, 650.0
NAN = math.nan
IMAGES_URL = "mftp://[;comp=1]/card/image"


class PayloadHarness:
    """Ten metres above home, heading north, in hold, by default."""

    def __init__(
        self,
        *,
        device: CameraDevice | None = None,
        recorder: Recorder | None = None,
        seeker: Seeker | None = None,
        streamer: Streamer | None = None,
        **params: float,
    ) -> None:
        self.registry = Registry()
        self.orders: Queue[PayloadOrder] = Queue(2000)
        self.region: Topic[RegionOfInterest] = Topic()
        self.attitude: Topic[VehicleAttitude] = Topic()
        self.local_position: Topic[VehicleLocalPosition] = Topic()
        self.home: Topic[HomePosition] = Topic()
        self.status: Topic[VehicleStatus] = Topic()
        self.setpoint: Topic[TrajectorySetpoint] = Topic()
        self.acks: Queue[VehicleCommandAck] = Queue()
        self.texts: Queue[StatusText] = Queue()
        self.events: Queue[CameraEvent] = Queue(2000)
        self.camera: Topic[CameraStatus] = Topic()
        self.lens: Topic[CameraLens] = Topic()
        self.gimbal: Topic[GimbalStatus] = Topic()
        self.tracking: Topic[TrackingState] = Topic()
        self.module = PayloadModule(
            self.registry,
            system_id=SYSTEM,
            boot_time_utc_us=1_700_000_000_000_000,
            orders=self.orders,
            region_of_interest=self.region,
            attitude=self.attitude,
            local_position=self.local_position,
            home=self.home,
            vehicle_status=self.status,
            trajectory_setpoint=self.setpoint,
            command_ack=self.acks,
            status_text=self.texts,
            camera_event=self.events,
            camera_status=self.camera,
            camera_lens=self.lens,
            gimbal_status=self.gimbal,
            tracking_state=self.tracking,
            device=device,
            recorder=recorder,
            seeker=seeker,
            streamer=streamer,
            images_url=IMAGES_URL,
        )
        for name, value in params.items():
            self.registry.set(name, value)
        self.now_us = 0
        self.velocity: Vector3 = (0.0, 0.0, 0.0)
        self.position: Vector3 = (0.0, 0.0, -10.0)
        self.heading_deg = 0.0
        self.home.publish(
            HomePosition(0, LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_M, (0.0, 0.0, 0.0), 0.0)
        )
        self.flies(NavigationState.AUTO_LOITER)
        self._token = 0

    def flies(self, state: NavigationState, *, armed: bool = True) -> None:
        """Put the vehicle into a mode."""
        self.status.publish(
            VehicleStatus(
                self.now_us,
                armed=armed,
                navigation_state=state,
                failsafe=False,
                preflight_checks_pass=True,
                armed_since_us=0,
                sensors_present=0,
                sensors_enabled=0,
                sensors_health=0,
            )
        )

    def leads(self, to: Vector3, speed_m_s: float) -> None:
        """Let the setpoint lead north from where the vehicle is, at a speed."""
        velocity, still = (speed_m_s, 0.0, 0.0), (0.0, 0.0, 0.0)
        self.setpoint.publish(
            TrajectorySetpoint(self.now_us, self.position, velocity, still, NAN, 0.0, to)
        )

    def run(self, seconds: float) -> None:
        """Let vehicle time pass, at a constant velocity."""
        for _ in range(round(seconds * 1e6 / PERIOD_US)):
            self.now_us += PERIOD_US
            dt = PERIOD_US * 1e-6
            north, east, down = (
                p + dt * v for p, v in zip(self.position, self.velocity, strict=True)
            )
            self.position = (north, east, down)
            self._estimate()
            self.module.update(self.now_us)

    def _estimate(self) -> None:
        heading = math.radians(self.heading_deg)
        self.attitude.publish(
            VehicleAttitude(self.now_us, from_euler(0.1, -0.1, heading), (0.0, 0.0, 0.0))
        )
        self.local_position.publish(
            VehicleLocalPosition(
                self.now_us,
                self.position,
                self.velocity,
                (0.0, 0.0, 0.0),
                heading,
                LATITUDE_DEG,
                LONGITUDE_DEG,
                ALTITUDE_M,
                0.5,
                0.5,
                position_valid=True,
                altitude_valid=True,
                velocity_valid=True,
                heading_valid=True,
            )
        )

    def order(self, number: int, *p: float, sender: Controller = OPERATOR, frame: int = 0) -> int:
        """Send a command, missing parameters being 0; return its token (0 for the mission)."""
        own = sender == MISSION
        self._token += 1
        token = 0 if own else self._token
        p1, p2, p3, p4, p5, p6, p7 = [*map(float, p), *[0.0] * (7 - len(p))]
        self.orders.publish(
            VehicleCommand(self.now_us, number, p1, p2, p3, p4, p5, p6, p7, frame, *sender, token)
        )
        return token

    def command(self, number: int, *p: float, sender: Controller = OPERATOR) -> int:
        """Send a command, run a step, and return the result."""
        token = self.order(number, *p, sender=sender)
        self.run(PERIOD_US * 1e-6)
        (ack,) = [ack for ack in self.acks.drain() if ack.token == token]
        return ack.result

    def pictures(self) -> list[ImageCaptured]:
        """Pictures since the last call."""
        return [event for event in self.events.drain() if isinstance(event, ImageCaptured)]

    def status_texts(self) -> str:
        """Status texts since the last call."""
        return "\n".join(text.text for text in self.texts.drain())

    @property
    def pitch_deg(self) -> float:
        return math.degrees(self._gimbal.pitch)

    @property
    def yaw_deg(self) -> float:
        """From north."""
        return math.degrees(self._gimbal.yaw)

    @property
    def _gimbal(self) -> GimbalStatus:
        assert self.gimbal.value is not None
        return self.gimbal.value

    @property
    def camera_status(self) -> CameraStatus:
        assert self.camera.value is not None
        return self.camera.value

    @property
    def tracked(self) -> Any:
        assert self.tracking.value is not None
        return self.tracking.value
