"""Commands that take pictures, and the command to which each picture is attributed."""

from mavlink_broker.pictures.attribution import Attribution, PictureCommand

FIRST, SECOND = 100, 101
"""Components that are cameras."""


def taker(command: int, expected: int = 0) -> PictureCommand:
    """A command of mission 7 that takes so many pictures."""
    return PictureCommand("1/01PLAN", 7, command, command + 1, expected)


def commands_of(attribution: Attribution, *times_s: float, camera: int = FIRST) -> list[int | None]:
    """Attribute pictures of these times; gives the command of each."""
    takers = [attribution.attribute(time_s, camera) for time_s in times_s]
    return [None if one is None else one.command for one in takers]
