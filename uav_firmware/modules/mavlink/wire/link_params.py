"""Parameters of what the links carry."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkParams:
    """What is streamed unprompted; read at the start, as on PX4."""

    ground_station_mode: int = param(
        "MAV_0_MODE", 0, unit="1", minimum=0, maximum=2,
        short="Streams to the ground station: 0 normal, 1 heartbeat alone, 2 onboard",
    )  # fmt: skip
    onboard_mode: int = param(
        "MAV_1_MODE", 2, unit="1", minimum=0, maximum=2,
        short="Streams to the broker or companion: 0 normal, 1 heartbeat alone, 2 onboard",
    )  # fmt: skip
