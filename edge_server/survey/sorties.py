"""Which vehicle flies which part, and where a battery ends and the next flight continues; pure."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from edge_server.survey.home_paths import HomePaths
from edge_server.survey.plane import Point
from edge_server.survey.route import Stop

CLIMB_M_S = 1.5
STOP_S = 2.0
"""Time that slowing down and speeding up again costs at a place."""
PICTURE_S = 1.5
LEAST_GAIN_M = 5.0
"""Vehicles exchange their shares for it: less is within the error of their positions."""
RESERVE = 1.3
"""A flight is planned to need the battery's time divided by this."""


@dataclass(frozen=True, slots=True)
class Flight:
    """What bounds one flight of one vehicle."""

    home_paths: HomePaths
    height_m: float
    bend_height_m: float
    """Between home and the field, where other vehicles fly too."""
    speed_m_s: float
    endurance_s: float
    takes_pictures: bool
    most_commands: int


def seconds_between(start: Point, end: Point, flight: Flight) -> float:
    """Time to fly from one place to the next and stop there."""
    return math.dist(start, end) / flight.speed_m_s + STOP_S


def seconds_of(stops: Sequence[Stop], flight: Flight) -> float:
    """Time of a flight from home over these stops and home again, round no-fly areas."""
    if not stops:
        return 0.0
    legs = itertools.pairwise(_path(stops, flight))
    out, back = _bends(stops, flight)
    pictures = sum(stop.is_work for stop in stops) * PICTURE_S if flight.takes_pictures else 0.0
    height_m = max(flight.height_m, flight.bend_height_m) if out or back else flight.height_m
    climb = 2.0 * height_m / CLIMB_M_S
    return sum(seconds_between(a, b, flight) for a, b in legs) + pictures + climb


def length_m(stops: Sequence[Stop], flight: Flight) -> float:
    """Length over ground of a flight from home over these stops and home again."""
    return sum(math.dist(a, b) for a, b in itertools.pairwise(_path(stops, flight)))


def _path(stops: Sequence[Stop], flight: Flight) -> list[Point]:
    home = flight.home_paths.home
    out, back = _bends(stops, flight)
    return [home, *out, *(stop.point for stop in stops), *back, home]


def commands_of(stops: Sequence[Stop], flight: Flight) -> int:
    """How many commands these stops become, take-off, bends and return included."""
    pictures = sum(stop.is_work for stop in stops) if flight.takes_pictures else 0
    bends = sum(map(len, _bends(stops, flight))) if stops else 0
    return len(stops) + pictures + bends + 2


def flown(stops: Sequence[Stop], flight: Flight) -> list[tuple[Stop, float]]:
    """A flight with the bends on its paths from home and back, and the height of each stop [m]."""
    out, back = (
        [(Stop(point, is_work=False), flight.bend_height_m) for point in points]
        for points in _bends(stops, flight)
    )
    return [*out, *((stop, flight.height_m) for stop in stops), *back]


def _bends(stops: Sequence[Stop], flight: Flight) -> tuple[Sequence[Point], Sequence[Point]]:
    """On the path from home to the first of these stops, and from the last one home."""
    paths = flight.home_paths
    return paths.bends(stops[0].point), paths.bends(stops[-1].point)[::-1]


class TooFarError(Exception):
    """A single place cannot be reached and left again on one battery."""


class TooManyCommandsError(Exception):
    """A single place, and the bends on the paths there and back, are too much for a mission."""


def split(stops: Sequence[Stop], parts: int, flight: Flight) -> list[list[Stop]]:
    """Cut a route into so many parts of about the same time, in its order."""
    costs = [
        seconds_between(before.point, stop.point, flight) + PICTURE_S * flight.takes_pictures
        for before, stop in zip([stops[0], *stops], stops, strict=False)
    ]
    share = sum(costs) / parts
    found: list[list[Stop]] = [[] for _ in range(parts)]
    passed = 0.0
    for stop, cost in zip(stops, costs, strict=True):
        found[min(int(passed / share), parts - 1)].append(stop)
        passed += cost
    return [trimmed for part in found if (trimmed := _trimmed(part))]


def assign(shares: Sequence[Sequence[Stop]], homes: Sequence[Point]) -> list[int]:
    """Choose for each share the home from which it is flown, as an index; each home once at most.

    The shares go to the homes in their order, and then two homes exchange theirs as long as that
    shortens the straight lines there and back. From one common home the order stays.
    """
    chosen = list(range(len(homes)))  # Behind the shares: homes without any

    def cost_m(number: int, home: int) -> float:
        if number >= len(shares):
            return 0.0
        share = shares[number]
        return math.dist(homes[home], share[0].point) + math.dist(homes[home], share[-1].point)

    def exchange_gains() -> bool:
        for one, other in itertools.combinations(range(len(homes)), 2):
            a, b = chosen[one], chosen[other]
            gain_m = cost_m(one, a) + cost_m(other, b) - cost_m(one, b) - cost_m(other, a)
            if gain_m > LEAST_GAIN_M:
                chosen[one], chosen[other] = b, a
                return True
        return False

    while exchange_gains():
        pass
    return chosen[: len(shares)]


def flights(stops: Sequence[Stop], flight: Flight) -> list[list[Stop]]:
    """Cut a vehicle's part into flights; each continues where the one before ended.

    Raises:
        TooFarError: if even one place is too much for a battery.
        TooManyCommandsError: if it is too much for a mission.
    """
    straight = replace(flight, home_paths=flight.home_paths.straight())
    found = []
    begin = 0
    while begin < len(stops):
        end = _end(stops, begin, flight, straight)
        if end == begin:
            raise _refusal(stops[begin], flight)
        if trimmed := _trimmed(stops[begin:end]):
            found.append(trimmed)
        begin = end
    return found


def _end(stops: Sequence[Stop], begin: int, flight: Flight, straight: Flight) -> int:
    """Where a flight that begins at a stop ends; there already if even one place is too much."""
    end = begin
    while end < len(stops) and _fits(stops[begin : end + 1], straight):
        end += 1
    # No path is shorter than the straight line: only from here on is one looked for
    while end > begin and not _fits(_trimmed(stops[begin:end]), flight):
        end -= 1
    return end


def _refusal(stop: Stop, flight: Flight) -> TooFarError | TooManyCommandsError:
    distance = math.dist(flight.home_paths.home, stop.point)
    if commands_of([stop], flight) > flight.most_commands:
        return TooManyCommandsError(
            f"is too small for a place {distance:.0f} m from home: the path round no-fly areas "
            f"takes {commands_of([stop], flight)} commands"
        )
    return TooFarError(
        f"a place {distance:.0f} m from home cannot be reached and left on one battery"
    )


def _fits(stops: Sequence[Stop], flight: Flight) -> bool:
    if commands_of(stops, flight) > flight.most_commands:
        return False
    return seconds_of(stops, flight) * RESERVE <= flight.endurance_s


def _trimmed(stops: Sequence[Stop]) -> list[Stop]:
    """Without the bends at either end, which lead nowhere any more."""
    work = [index for index, stop in enumerate(stops) if stop.is_work]
    return list(stops[work[0] : work[-1] + 1]) if work else []
