"""What is known between two mission items while they become commands.

Refusal  why an item cannot be translated; becomes a fault at the item's place
"""

from dataclasses import dataclass, field
from typing import Any, Final

from afarcloud.enumerations import CommandType
from afarcloud.faults import Fault
from edge_server.exchange.mission_item import ABSOLUTE, RELATIVE, Home, Item, Place

MOST_COMMANDS: Final = 700
"""Of one mission."""


class Refusal(Exception):  # noqa: N818  # it is the result of a file
    """Why an item cannot be translated to commands."""


@dataclass(slots=True)
class Translation:
    """What is known between two items."""

    home: Home | None
    zero_yaw_is_unset: bool
    speed_m_s: float | None
    commands: list[dict[str, Any]] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    place: Place | None = None
    is_speed_set: bool = False
    has_flown: bool = False  # Farther than the take-off
    heading: tuple[Item, float] | None = None  # For the next place
    gimbal: tuple[Item, float, float | None] | None = None  # Pitch and heading
    gimbal_is_used: bool = True
    picture_spacing_m: float | None = None
    since_picture_m: float = 0.0
    bare: bool = False  # The last command is a waypoint with no more than its place
    hold: Item | None = None  # The mission ended here

    def add(self, item: Item, kind: CommandType, **parameters: Any) -> None:
        """Append a command."""
        if len(self.commands) >= MOST_COMMANDS:
            raise Refusal(
                f"needs more than {MOST_COMMANDS} commands, which a mission cannot have; split "
                "it, or let POST /surveys/ plan the field"
            )
        self.commands.append(
            {
                "command_id": len(self.commands) + 1,
                "command_type_id": int(kind),
                "parameters": parameters,
            }
        )
        self.paths.append(item.path)
        self.bare = False

    def take_back(self) -> dict[str, Any]:
        """Remove the last command; returns its parameters."""
        self.paths.pop()
        parameters: dict[str, Any] = self.commands.pop()["parameters"]
        return parameters

    def warn(self, item: Item, message: str) -> None:
        """Warn about what is done differently from the item."""
        self.warnings.append(Fault(item.path, f"{item.title}: {message}"))

    def relative_altitude_m(self, item: Item) -> float:
        """Height above home of an item with a place."""
        altitude = item.parameters[6]
        if altitude is None:
            raise Refusal("has no altitude")
        if item.frame in RELATIVE:
            return altitude
        if item.frame not in ABSOLUTE:
            raise Refusal(f"has its altitude in frame {item.frame}; above home or sea level only")
        if self.home is None or self.home.altitude_amsl_m is None:
            raise Refusal("has an altitude above sea level, but the file has no altitude of home")
        return round(altitude - self.home.altitude_amsl_m, 3)

    def place_of(self, item: Item, otherwise: Place | Home | None = None) -> Place:
        """Where an item is; 0, 0 and nothing mean "here" to autopilots."""
        latitude, longitude = item.parameters[4:6]
        if not latitude and not longitude:
            if otherwise is None:
                raise Refusal("has no position")
            latitude, longitude = otherwise[0], otherwise[1]
        if latitude is None or longitude is None:
            raise Refusal("has half a position")
        return Place(latitude, longitude, self.relative_altitude_m(item))

    def heading_of(self, value: float | None) -> float | None:
        """Heading at a place: that of the item, or of a turn that was requested before it."""
        if self.heading is not None:
            (_, heading), self.heading = self.heading, None
            return heading
        if value is None or (value == 0.0 and self.zero_yaw_is_unset):
            return None
        return value % 360.0 if value == 360.0 else value


def whole(value: float | None, what: str, otherwise: int) -> int:
    """Read a parameter that counts or numbers something; raises Refusal for a fraction."""
    if value is None:
        return otherwise
    if value != int(value):
        raise Refusal(f"has a fraction for {what}")
    return int(value)


def unset(*values: float | None) -> bool:
    """Whether none of them has a value; autopilots read 0 as none."""
    return not any(values)
