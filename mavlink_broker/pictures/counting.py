"""Which pictures of one camera have been announced; lost announcements are asked for again.

A camera numbers its pictures from 0 without gaps and announces each of them once. What is missing
between two numbers, or behind the last one by the camera's own count, is asked for again:
REQUEST_MESSAGE(512) of CAMERA_IMAGE_CAPTURED(263) with the number. A broker that was restarted
asks back from the newest, as far as pictures may be of its missions.
"""

from dataclasses import dataclass
from typing import Final

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import long_command
from mavlink_broker.microservices.round_trip import RoundTrip
from mavlink_broker.pictures.capture import Capture

WINDOW: Final = 4
ATTEMPTS: Final = 20
FIRST_PAUSE_S: Final = 0.5
LONGEST_PAUSE_S: Final = 10.0
"""A camera announces a picture when it has stored it, which may take a while."""
KEPT: Final = 4000
"""Numbers that are remembered; older ones cannot be missing any more."""
LARGEST_GAP: Final = 200
"""A camera whose numbers leap further has been exchanged, or emptied."""
_STATUS: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS
_IMAGE: Final[int] = mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED


@dataclass(slots=True)
class _Wish:
    due_at: float = 0.0
    attempts: int = 0


class PictureCount:
    """One camera of one vehicle."""

    def __init__(self, component: int, route: Route, round_trip: RoundTrip) -> None:
        self._component = component
        self._route = route
        self._round_trip = round_trip
        self._heard: dict[int, str] = {}  # Number to identity, oldest first but for gaps
        self._newest = -1  # The highest number of these
        self._first: int | None = None  # What lies before is nobody's here
        self._status: _Wish | None = None
        self._images: dict[int, _Wish] = {}
        self._goes_back = False

    @property
    def is_asking(self) -> bool:
        """Whether something is still being asked for."""
        return self._status is not None or bool(self._images)

    def ask_count(self, *, go_back: bool = False) -> None:
        """Ask the camera how many it has taken; `go_back` to pictures that were not heard of."""
        self._goes_back |= go_back
        self._status = self._status or _Wish()

    def take(self, capture: Capture, *, goes_back: bool) -> bool:
        """Take an announcement; whether it is news. `goes_back`: those before it matter too."""
        number = capture.index
        was_wanted = self._images.pop(number, None) is not None
        if self._heard.get(number) == capture.identity:
            return False
        if not was_wanted and self._is_of_another_camera(number):
            self._heard.clear()
            self._newest = -1
            self._images.clear()
            self._first = number
        if self._goes_back and was_wanted and number <= min(self._heard, default=number):
            self._goes_back = goes_back and number > 0
            if self._goes_back:
                self._images[number - 1] = _Wish()
        self._remember(number, capture.identity)
        self._first = number if self._first is None else self._first
        self._miss_up_to(number)
        return True

    def told(self, image_count: int) -> None:
        """Take CAMERA_CAPTURE_STATUS.image_count: the newest picture has the number before it."""
        self._status = None
        if image_count < 0:
            return
        if self._first is None:
            self._first = image_count
        if self._goes_back:
            self._begin_back(image_count)
        if image_count <= self._newest + LARGEST_GAP:
            self._miss_up_to(image_count)

    def _begin_back(self, image_count: int) -> None:
        newest = min(self._heard, default=image_count) - 1
        if newest >= 0:
            self._images.setdefault(newest, _Wish())

    def tick(self, now: float) -> tuple[list[Message], list[int]]:
        """Ask again what is overdue; gives the messages, and the numbers that are given up."""
        messages, lost = [], []
        if self._status is not None and now >= self._status.due_at:
            if self._status.attempts >= ATTEMPTS:
                self._status = None  # It keeps no count
                if self._goes_back and self._heard:
                    self._begin_back(0)
            else:
                messages.append(self._request(self._status, now, _STATUS))
        for number in sorted(self._images)[:WINDOW]:
            wish = self._images[number]
            if now < wish.due_at:
                continue
            if wish.attempts >= ATTEMPTS:
                del self._images[number]
                self._remember(number, "")
                lost.append(number)
            else:
                messages.append(self._request(wish, now, _IMAGE, number))
        return messages, lost

    def _request(self, wish: _Wish, now: float, message_id: int, number: int = 0) -> Message:
        wish.attempts += 1
        pause_s = max(FIRST_PAUSE_S, self._round_trip.timeout_s) * 1.5**wish.attempts
        wish.due_at = now + min(pause_s, LONGEST_PAUSE_S)
        command = long_command(
            mavlink.MAV_CMD_REQUEST_MESSAGE, message_id, number, component=self._component
        )
        return command.message(self._route, 0)

    def _is_of_another_camera(self, number: int) -> bool:
        """Whether the camera counts anew: it was exchanged, emptied or restarted."""
        if not self._heard:
            return False
        is_other = bool(self._heard.get(number))
        return is_other or number < (self._first or 0) or number > self._newest + LARGEST_GAP

    def _remember(self, number: int, identity: str) -> None:
        """Note that a number was heard, or is given up; the oldest are forgotten."""
        self._heard[number] = identity
        self._newest = max(self._newest, number)
        if len(self._heard) > KEPT:
            del self._heard[next(iter(self._heard))]

    def _miss_up_to(self, number: int) -> None:
        first = max(self._first or 0, number - LARGEST_GAP)
        for missing in range(first, number):
            if missing not in self._heard:
                self._images.setdefault(missing, _Wish())
