"""What must hold of cameras.

Each picture arrives, and belongs to the command that took it; no camera tracks on in the end.
"""

import math
import re
from http import HTTPStatus
from typing import Final

from dst.actors.operator_person import Operator, PostedPlan
from dst.actors.plans import RADIUS_M, PlannedPictures
from dst.vehicles.flight import Truth, offset_m
from dst.vehicles.pictures import PANORAMA_INTERVAL_S, SINGLE, Picture, url_in
from dst.vehicles.vehicle import Vehicle
from dst.world.world import World
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post

PATH: Final = "/image/"
_NAME: Final = re.compile(r"m(\d+)_c(\d+)_\d+\.\w+")


class PictureLaws:
    """Watches the pictures of a world; `broken` has what is wrong."""

    def __init__(self, world: World, operator: Operator) -> None:
        self._world = world
        self._operator = operator
        self._arrived: dict[str, str] = {}  # By URL: the name
        self.broken: list[str] = []

    def taken(self, post: Post, answer: Answer) -> None:
        """Note a picture that the edge server has stored."""
        if post.path != PATH or answer.status_code != HTTPStatus.CREATED:
            return
        name, url = post.body["name"], url_in(post.body["frame"])
        before = self._arrived.setdefault(url, name)
        if before != name:
            self.broken.append(f"{url} has arrived as {before}, and as {name}")
        picture = self._truth(post.vehicle_id).get(url)
        match = _NAME.fullmatch(name)
        if picture is None:
            self.broken.append(f"{url} was never taken")
        elif post.vehicle_id in self._world.twinned:
            return  # Which of the two has taken which picture is not judged
        elif match is not None and not self._is_of(post.vehicle_id, picture, match):
            ordered = f"ordered as {picture.series}"
            text = f"{name} is {url}, which was taken at {picture.place_e7}, {ordered}"
            self.broken.append(text)

    def has_taken(self, plan: PostedPlan, command_id: int) -> bool:
        """Whether a picture was taken as a command of a plan orders some, since it was posted.

        The second aircraft with a system id has no camera.
        """
        return plan.vehicle_id in self._world.twinned or any(
            picture.time_s > plan.posted_s and _is_of(plan.commands.pictures[command_id], picture)
            for truth in self._world.truths(plan.vehicle_id)
            for picture in truth.pictures
        )

    def has_tracked(self, plan: PostedPlan, command_id: int) -> bool:
        """Whether a camera was ordered to track the subject of a command, since it was posted."""
        return plan.vehicle_id in self._world.twinned or any(
            tracked.time_s > plan.posted_s
            and tracked.rectangle == plan.commands.subjects[command_id]
            for truth in self._world.truths(plan.vehicle_id)
            for tracked in truth.tracked
        )

    def missing(self) -> list[str]:
        """Give what cameras still track, and what has not arrived of each vehicle's last boot.

        A camera counts anew with each boot: what it has taken before cannot be asked for any more.
        """
        found = [
            f"the camera of vehicle {system} tracks a subject"
            for system, vehicle in self._world.vehicles.items()
            if vehicle.truth.is_tracking and system not in self._world.twinned
        ]
        for system, vehicle in self._world.vehicles.items():
            if isinstance(vehicle, Vehicle) and system not in self._world.twinned:
                taken = vehicle.truth.pictures
                urls = [one.url for one in taken if one.time_s > vehicle.booted_at_s]
                found += [f"{url} is missing" for url in urls if url not in self._arrived]
        return found

    def _truth(self, system: int) -> dict[str, Picture]:
        truths: list[Truth] = self._world.truths(system)
        return {one.url: one for truth in truths for one in truth.pictures}

    def _is_of(self, system: int, picture: Picture, name: re.Match[str]) -> bool:
        """Whether a plan has a command of this name that orders the picture."""
        mission_id, command_id = map(int, name.groups())
        return any(
            _is_of(plan.commands.pictures[command_id], picture)
            for plan in self._operator.plans
            if (plan.vehicle_id, plan.mission_id) == (system, mission_id)
            and command_id in plan.commands.pictures
        )


def _is_of(planned: PlannedPictures, picture: Picture) -> bool:
    """Whether a command orders a picture: at this place, in such a series."""
    is_ordered = picture.series == planned.series
    if planned.series is None:
        is_ordered = picture.series == SINGLE or picture.series.interval_s == PANORAMA_INTERVAL_S
    return is_ordered and _is_near(planned.place_e7, picture.place_e7)


def _is_near(one_e7: tuple[int, int] | None, other_e7: tuple[int, int] | None) -> bool:
    """Whether two places are one; a vehicle may turn for a panorama where it has left a circle."""
    if one_e7 is None or other_e7 is None:
        return False
    one_m, other_m = (offset_m(place[0] / 1e7, place[1] / 1e7) for place in (one_e7, other_e7))
    return math.dist(one_m, other_m) <= RADIUS_M + 1.0
