"""A flight whose third command takes pictures, between scripted ends."""

import dataclasses
from pathlib import Path
from typing import Any

from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import World, go_home, mission, takeoff, waypoint
from tests.support.scripted_camera import ScriptedCamera
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import PX4

SLOW = dataclasses.replace(PX4, item_time_s=6.0)
MISSION = 1201


def image(command_id: int = 3, count: int = 1) -> dict[str, Any]:
    parameters = {
        "yaw_angle": 0,
        "pitch_angle": -90,
        "photo_count": count,
        "time_interval": int(count > 1),
    }
    return {"command_id": command_id, "command_type_id": 4, "parameters": parameters}


class PictureFlight:
    """A vehicle with a camera on a mission that takes pictures at its third command."""

    def __init__(
        self,
        *,
        count: int = 1,
        loss: float = 0.0,
        seed: int = 1,
        journal: Path | None = None,
        **camera: Any,
    ) -> None:
        self.world = World(loss=loss, seed=seed, journal=journal)
        self.vehicle: ScriptedVehicle = self.world.add_vehicle(script=SLOW)
        self.camera: ScriptedCamera = self.world.add_camera(self.vehicle, **camera)
        self.count = count

    def until_pictures(self) -> None:
        """Fly until the vehicle is at the item that takes the pictures."""
        self.until(mavlink.MAV_CMD_IMAGE_START_CAPTURE)

    def until(self, command: int) -> None:
        """Fly until the vehicle is at an item with that MAV_CMD for the first time."""
        self.world.edge.plan(
            mission(takeoff(), waypoint(), image(3, self.count), waypoint(4, 20.0), go_home(5))
        )
        self.world.run_until(lambda: self.item == command)
        self.world.run(1.0)

    @property
    def item(self) -> int:
        """The command of the item that is flown."""
        flies = self.vehicle.armed and self.vehicle.items
        return int(self.vehicle.items[self.vehicle.current].command) if flies else 0

    def land(self) -> None:
        """Fly to the end."""
        self.world.run_until_over(MISSION)
        self.world.run(15.0)

    @property
    def images(self) -> list[dict[str, Any]]:
        return self.world.edge.bodies("/image/")

    @property
    def names(self) -> list[str]:
        return [body["name"] for body in self.images]

    def message(self, command: int = 2) -> str | None:
        reports = self.world.edge.reports(MISSION)
        text: str | None = reports[-1]["command_report_array"][command].get("message")
        return text


def is_at(vehicle: ScriptedVehicle, command: int, number: int) -> bool:
    """Whether the vehicle is at an item with that MAV_CMD, the first one having the number 0."""
    places = [seq for seq, item in enumerate(vehicle.items) if item.command == command]
    return vehicle.armed and len(places) > number and vehicle.current >= places[number]


def number_of(name: str) -> int:
    return int(name.removesuffix(".jpeg").rpartition("_")[2])
