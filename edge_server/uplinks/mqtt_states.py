"""The life of the connection to the broker: one table."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class LinkState(StrEnum):
    """How far we are."""

    DOWN = "down"
    CONNECTING = "connecting"
    SUBSCRIBING = "subscribing"
    UP = "up"


class LinkHappening(StrEnum):
    """What moves it."""

    TRIED = "tried"
    ACCEPTED = "accepted"
    SUBSCRIBED = "subscribed"
    LOST = "lost"


LINK_TRANSITIONS: Final[Mapping[tuple[LinkState, LinkHappening], LinkState]] = {
    (LinkState.DOWN, LinkHappening.TRIED): LinkState.CONNECTING,
    (LinkState.CONNECTING, LinkHappening.ACCEPTED): LinkState.SUBSCRIBING,
    (LinkState.SUBSCRIBING, LinkHappening.SUBSCRIBED): LinkState.UP,
    (LinkState.CONNECTING, LinkHappening.LOST): LinkState.DOWN,
    (LinkState.SUBSCRIBING, LinkHappening.LOST): LinkState.DOWN,
    (LinkState.UP, LinkHappening.LOST): LinkState.DOWN,
}


def follow_link(state: LinkState, happening: LinkHappening) -> LinkState | None:
    """Give the next state; None for what does not belong there, such as a packet too late."""
    return LINK_TRANSITIONS.get((state, happening))
