"""The camera's own tracking of the simulated vehicle: finds what moves on the farm in the picture.

A camera that tracks has a processor for it, whose answer is a box in the picture. Here the boxes
are those of the farm's subjects, projected by the true pose, with the jitter of a real tracker.
A subject is not found while a building or a tree hides more than half of it.
"""

import math
from typing import Final

import numpy as np

from sim.camera.scene.lens import Lens, in_camera, multiplied
from sim.camera.scene.occlusion import share_in_sight
from sim.simulation import Simulation
from sim.world.subjects import Subject
from uav_firmware.cal.camera import Gaze
from uav_firmware.msg.payload import Box

JITTER: Final = 0.002
"""One sigma of a box's edges, as a share of the picture."""
_ENOUGH: Final = 0.5
"""[-] Share of a subject that is to be in sight."""
_PICTURE: Final = Box(0.0, 0.0, 1.0, 1.0)


class JsbsimSeeker:
    """Implements `uav_firmware.cal.camera.Seeker`."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._random = np.random.default_rng(simulation.config.seed)
        self._name: str | None = None

    def lock(self, box: Box, gaze: Gaze) -> bool:
        """Hold on to what is nearest to the middle of a box, if anything moves in it."""
        found: list[tuple[float, str]] = []
        for subject in self._subjects:
            seen = self._box(subject, gaze)
            if seen is not None and _overlap(seen, box) and self._is_in_sight(subject):
                found.append((math.dist(_middle(seen), _middle(box)), subject.name))
        self._name = min(found)[1] if found else None
        return self._name is not None

    def seen(self, gaze: Gaze) -> Box | None:
        """Where what is held on to is seen; None when it is hidden or not in the picture."""
        for subject in self._subjects:
            if subject.name == self._name:
                box = self._box(subject, gaze)
                if box is None or not _overlap(box, _PICTURE) or not self._is_in_sight(subject):
                    return None
                jitter = JITTER * self._simulation.config.sensor_noise_factor
                edges = np.array(box) + jitter * self._random.standard_normal(4)
                return Box(*(float(edge) for edge in edges))
        return None

    @property
    def _subjects(self) -> tuple[Subject, ...]:
        if self._simulation.camera_failed:
            return ()
        return self._simulation.farm.subjects(self._simulation.farm_time_s)

    def _is_in_sight(self, subject: Subject) -> bool:
        truth, farm = self._simulation.truth, self._simulation.farm
        plane = farm.plane
        here = plane.place(truth.latitude_deg, truth.longitude_deg)
        camera = (*here, truth.altitude_amsl_m - plane.altitude_amsl_m)
        return share_in_sight(farm, camera, subject) >= _ENOUGH

    def _box(self, subject: Subject, gaze: Gaze) -> Box | None:
        """A subject in the picture; None behind the camera."""
        truth, farm = self._simulation.truth, self._simulation.farm
        here = farm.plane.place(truth.latitude_deg, truth.longitude_deg)
        there = subject.place
        ground_m = farm.elevation_amsl_m(*farm.plane.geodetic(there))
        up_m = ground_m + 0.5 * subject.height_m - truth.altitude_amsl_m
        offset_ned = (there.north_m - here.north_m, there.east_m - here.east_m, -up_m)
        w, x, y, z = gaze.q_ned_frd
        q_frd_camera = multiplied((w, -x, -y, -z), gaze.q_ned_camera)
        forward, right, down = in_camera(multiplied(truth.q_ned_frd, q_frd_camera), offset_ned)
        if forward <= 0.0:
            return None
        lens = Lens(*gaze.lens)
        across, along = 2.0 * forward * lens.half_right, 2.0 * forward * lens.half_down
        half_m = 0.5 * max(subject.length_m, subject.height_m)
        column, row = 0.5 + right / across, 0.5 + down / along
        wide, tall = half_m / across, half_m / along
        return Box(column - wide, row - tall, column + wide, row + tall)


def _middle(box: Box) -> tuple[float, float]:
    return 0.5 * (box.left + box.right), 0.5 * (box.top + box.bottom)


def _overlap(one: Box, other: Box) -> bool:
    return (
        one.left < other.right
        and other.left < one.right
        and one.top < other.bottom
        and other.top < one.bottom
    )
