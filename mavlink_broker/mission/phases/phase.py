"""The hooks of a phase, which is one state of a mission.

    enter    the state begins
    receive  a message of the vehicle has arrived
    settle   the exchange of the phase has an outcome
    tick     time has passed
    leave    the state ends

`enter`, `settle` and `tick` return what follows: an event of the table of states, a fault, a
request to the mission, or None while the phase goes on.
"""

from dataclasses import dataclass
from enum import Enum, auto
from typing import TypeAlias

from mavlink_broker.effects import Effects
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mission.context import MissionContext
from mavlink_broker.mission.exchanges import Exchange, Outcome
from mavlink_broker.mission.states import Event
from mavlink_broker.vehicle.control_authority import Authority, Claim


@dataclass(frozen=True, slots=True)
class Fault:
    """Something was refused or went wrong, perhaps in one command (its index)."""

    reason: str
    command: int | None = None


class Request(Enum):
    """What a phase leaves to the mission, which knows the events that wait."""

    NEXT_SEGMENT = auto()  # The present segment has ended
    RETURN_HOME = auto()  # The mission has failed, and the vehicle waits in the air


Result: TypeAlias = Event | Fault | Request | None


class Phase:
    """One state of a mission; a hook that a phase does not need does nothing.

    `run` and `take_outcome` are no hooks: they run the one exchange that a phase has at a time.
    """

    exchange: Exchange[Outcome] | None = None
    """The protocol that runs with the vehicle; the mission passes messages and time to it."""

    def __init__(self, context: MissionContext) -> None:
        self._mission = context
        self._vehicle = context.vehicle

    @property
    def claim(self) -> Claim | None:
        """Modes in which the broker is in command; None: it orders nothing in this phase."""
        return None

    @property
    def was_taken(self) -> bool:
        """Whether another system has ended what the vehicle did in this phase."""
        return False

    @property
    def landed_by(self) -> Authority | None:
        """Who else had the vehicle when it was disarmed in this phase; None: nobody."""
        return None

    @property
    def was_given_up(self) -> bool:
        """Whether the vehicle waits in the air and does not continue its mission."""
        return False

    @property
    def flies_another(self) -> bool:
        """Whether the vehicle flies the mission of another system."""
        return False

    def is_progress_unknown(self, now: float) -> bool:
        """Whether it flies by an order of before, and may show soon how far it has come.

        An abort waits for that a moment, so that what was flown is reported.
        """
        del now
        return False

    def enter(self, now: float, effects: Effects) -> Result:
        """Begin."""
        del now, effects
        return None

    def receive(self, message: Message, now: float, effects: Effects) -> None:
        """Handle a message of the vehicle."""
        del message, now, effects

    def settle(self, outcome: Outcome, now: float) -> Result:
        """Judge the outcome of the exchange."""
        del outcome, now
        return None

    def tick(self, now: float, effects: Effects) -> Result:
        """Do what is due at a time."""
        del now, effects
        return None

    def run(self, exchange: Exchange[Outcome], now: float, effects: Effects) -> None:
        """Run a protocol with the vehicle from now on."""
        self.exchange = exchange
        effects.messages += exchange.start(now)

    def take_outcome(self, now: float) -> Result:
        """Judge the exchange, once it has an outcome."""
        outcome = None if self.exchange is None else self.exchange.outcome
        return None if outcome is None else self.settle(outcome, now)

    def leave(self) -> None:
        """End: drop the exchange."""
        self.exchange = None


class Idle(Phase):
    """The state IDLE: no mission, or one that has ended."""
