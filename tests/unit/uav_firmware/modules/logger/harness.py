"""A logger on its own topics, with log storage in memory that can fail."""

import errno
import io

from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no types

from uav_firmware.cal.log_store import LogStore
from uav_firmware.modules.logger.definitions import Identity
from uav_firmware.modules.logger.module import LoggerModule
from uav_firmware.modules.logger.params import LoggerParams
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.estimate import VehicleAttitude
from uav_firmware.msg.status import NavigationState, VehicleStatus
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

STEP_US = 4_000
UTC_US = 1_772_000_000_000_000


class MemoryFile:
    """A log file in memory; `room` bytes fit."""

    def __init__(self, room: int) -> None:
        self.contents = bytearray()
        self.room = room
        self.synced = False
        self.closed = False

    def write(self, chunk: bytes) -> None:
        assert not self.closed
        fits = chunk[: max(0, self.room - len(self.contents))]
        self.contents += fits
        if len(fits) < len(chunk):
            raise OSError(errno.ENOSPC, "No space left on device")

    def sync(self) -> None:
        assert not self.closed
        self.synced = True

    def close(self) -> None:
        self.closed = True


class MemoryStore:
    """Stores files in memory; with `broken`, none can be created."""

    def __init__(self, room: int = 10**9) -> None:
        self.files: list[MemoryFile] = []
        self.times_utc_us: list[int] = []
        self.room = room
        self.broken = False

    def free_bytes(self) -> int:
        if self.broken:
            raise OSError(errno.EIO, "Input/output error")
        return self.room

    def create(self, time_utc_us: int) -> MemoryFile:
        if self.broken:
            raise OSError(errno.EROFS, "Read-only file system")
        self.files.append(MemoryFile(self.room))
        self.times_utc_us.append(time_utc_us)
        return self.files[-1]

    def log(self, number: int = -1) -> ULog:
        return ULog(io.BytesIO(bytes(self.files[number].contents)))


def status(time_us: int, *, armed: bool) -> VehicleStatus:
    return VehicleStatus(
        time_us=time_us,
        armed=armed,
        navigation_state=NavigationState.AUTO_LOITER,
        failsafe=False,
        preflight_checks_pass=True,
        armed_since_us=time_us if armed else 0,
        sensors_present=0,
        sensors_enabled=0,
        sensors_health=0,
    )


class LoggerHarness:
    """The logger module, its clock, and the attitude and motors that are published in each step."""

    def __init__(self, store: LogStore | None) -> None:
        self.time_us = 0
        self.topics = Topics()
        self.registry = Registry()
        self.registry.add(LoggerParams)
        self.logger = LoggerModule(
            store,
            topics=self.topics,
            registry=self.registry,
            identity=Identity(system_id=5, software_version=1 << 24 | 16 << 16),
            boot_time_utc_us=UTC_US,
            step_us=STEP_US,
            time_us=lambda: self.time_us,
        )

    def run(self, seconds: float) -> None:
        """Advance time; publish attitude and motors in each step."""
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.time_us += STEP_US
            self.topics.vehicle_attitude.publish(
                VehicleAttitude(self.time_us, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            )
            self.topics.actuator_motors.publish(ActuatorMotors(self.time_us, (0.1, 0.2, 0.3, 0.4)))
            self.logger.update()

    def storage(self) -> tuple[int, bool]:
        """Free space [bytes] and whether a log failed, as last published."""
        status = self.topics.storage_status.value
        assert status is not None
        return status.free_bytes, status.refused

    def set_armed(self, *, armed: bool) -> None:
        self.topics.vehicle_status.publish(status(self.time_us, armed=armed))

    def fly(self, seconds: float) -> None:
        """Arm, fly, disarm, and wait until the log must have ended."""
        self.set_armed(armed=True)
        self.run(seconds)
        self.set_armed(armed=False)
        self.run(2.0)

    def warnings(self) -> list[str]:
        return [text.text for text in self.topics.status_text.drain()]
