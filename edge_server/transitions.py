"""State machines as data: a table of (state, trigger) -> next state, and its lookup."""

from collections.abc import Mapping
from typing import Generic, TypeVar

_State = TypeVar("_State")
_Trigger = TypeVar("_Trigger")


class IllegalTransitionError(Exception):
    """The state has no transition for this trigger; nothing has changed."""


class TransitionTable(Generic[_State, _Trigger]):
    """All transitions of one kind of thing."""

    def __init__(self, name: str, transitions: Mapping[tuple[_State, _Trigger], _State]) -> None:
        """Hold these transitions; `name` names the thing in errors, such as "an event"."""
        self._name = name
        self.transitions = transitions

    def follow(self, state: _State, trigger: _Trigger) -> _State:
        """Return the next state.

        Raises:
            IllegalTransitionError: if the table has no such transition.
        """
        following = self.get(state, trigger)
        if following is None:
            raise IllegalTransitionError(f"{self._name} that is {state} cannot be {trigger}")
        return following

    def get(self, state: _State, trigger: _Trigger) -> _State | None:
        """Return the next state; None if the table has no such transition."""
        return self.transitions.get((state, trigger))
