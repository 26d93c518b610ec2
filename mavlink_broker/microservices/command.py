"""MAVLink's command protocol, sender's side: commands that are repeated until they are answered.

Each repetition increments `confirmation`, so that the receiver does not act twice. IN_PROGRESS
extends the timeout; a temporary rejection is retried after a pause. Each command has exactly one
outcome.

Some firmware accepts a command before it judges it, and answers again when it has. Of such a
command the second answer counts, or the first one where no second follows.

The timeout of a repeated request, here and in every other microservice, follows the round trip of
the link (`RoundTrip`): smoothed round trip and variation as in RFC 6298 section 2, with limits for
MAVLink links from the loopback to a satellite modem. Only requests that were not repeated are
sampled (Karn's algorithm), because the answer to a repetition is ambiguous. A link that is slower
than the first timeout would then never be sampled: when every request had to be repeated, the time
since the first one is taken, which is too long rather than too short.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from mavlink_broker.mavlink.dialect import RESULT_NAMES, Message, Route, mav_cmd_name, mavlink

FIRST_TIMEOUT_S: Final = 1.0
SHORTEST_TIMEOUT_S: Final = 0.3
LONGEST_TIMEOUT_S: Final = 5.0
AMBIGUOUS_IN_A_ROW: Final = 2
_SMOOTHED_GAIN: Final = 1 / 8
_VARIATION_GAIN: Final = 1 / 4


class RoundTrip:
    """Estimate for one vehicle's link."""

    def __init__(self) -> None:
        self._smoothed_s: float | None = None
        self._variation_s = 0.0
        self._ambiguous = 0

    def sample_repeated(self, seconds: float) -> None:
        """Add the time [s] from the first of several requests to an answer to one of them."""
        self._ambiguous += 1
        if self._ambiguous >= AMBIGUOUS_IN_A_ROW:
            self.sample(min(seconds, LONGEST_TIMEOUT_S))

    def sample(self, seconds: float) -> None:
        """Add the time [s] between a request and its answer."""
        self._ambiguous = 0
        if self._smoothed_s is None:
            self._smoothed_s = seconds
            self._variation_s = seconds / 2
            return
        error = seconds - self._smoothed_s
        self._variation_s += _VARIATION_GAIN * (abs(error) - self._variation_s)
        self._smoothed_s += _SMOOTHED_GAIN * error

    @property
    def timeout_s(self) -> float:
        """Time after which a request is repeated."""
        if self._smoothed_s is None:
            return FIRST_TIMEOUT_S
        wanted = self._smoothed_s + 4 * self._variation_s
        return min(max(wanted, SHORTEST_TIMEOUT_S), LONGEST_TIMEOUT_S)


ATTEMPTS: Final = 8
"""At 20 % loss each way one command in 3,500 stays unanswered."""
PROGRESS_TIMEOUT_S: Final = 3.0
REJECTION_PAUSE_S: Final = 1.0
REJECTIONS: Final = 5
JUDGED_WITHIN_S: Final = 0.3
"""Longest time from the early acceptance of a command to its judgement: PX4 needs some 20 ms."""

Seven: TypeAlias = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandLong:
    """A command whose seven parameters are floats."""

    command: int
    parameters: Seven = (0.0,) * 7
    component: int | None = None  # None: the autopilot; else e.g. a camera
    wait_s: float = 0.0  # In a sequence: between the acceptance of the command before and this one

    def message(self, route: Route, confirmation: int) -> Message:
        """COMMAND_LONG(76) for one vehicle."""
        return mavlink.MAVLink_command_long_message(
            route.target_system,
            route.target_component if self.component is None else self.component,
            self.command,
            confirmation,
            *self.parameters,
        )


def long_command(command: int, *values: float, component: int | None = None) -> CommandLong:
    """Make a command from its first parameters; the others are 0."""
    p1, p2, p3, p4, p5, p6, p7 = (*map(float, values), *(0.0,) * (7 - len(values)))
    return CommandLong(
        command=command, parameters=(p1, p2, p3, p4, p5, p6, p7), component=component
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandInt:
    """A command with a position; its altitude is above mean sea level."""

    command: int
    parameters: tuple[float, float, float, float] = (0.0,) * 4
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    wait_s: float = 0.0  # As of CommandLong

    def message(self, route: Route, confirmation: int) -> Message:
        """COMMAND_INT(75) for one vehicle; it has no confirmation field."""
        del confirmation
        return mavlink.MAVLink_command_int_message(
            route.target_system,
            route.target_component,
            mavlink.MAV_FRAME_GLOBAL,
            self.command,
            0,
            0,
            *self.parameters,
            round(self.latitude_deg * 1e7),
            round(self.longitude_deg * 1e7),
            self.altitude_m,
        )


Command: TypeAlias = CommandLong | CommandInt


@dataclass(frozen=True, slots=True)
class Accepted:
    """The vehicle has accepted the command."""


@dataclass(frozen=True, slots=True)
class Refused:
    """The vehicle has refused the command, or has not answered."""

    reason: str
    result: int | None = field(default=None, compare=False)  # MAV_RESULT; None: no answer


CommandOutcome: TypeAlias = Accepted | Refused

EXPIRED: Final = Refused("expired before the vehicle has accepted it")


class CommandTransaction:
    """One command until its final answer."""

    def __init__(
        self,
        command: Command,
        route: Route,
        round_trip: RoundTrip,
        *,
        is_repetition: bool = False,
        is_accepted_early: bool = False,
        sends_until: float = math.inf,
    ) -> None:
        """Prepare a command.

        Args:
            command: What is sent.
            route: Source and target ids.
            round_trip: Estimate of the link's round trip.
            is_repetition: The vehicle may have received the command before.
            is_accepted_early: The vehicle accepts it first, and judges it afterwards.
            sends_until: From this time [s] on it is not repeated, as it has expired.
        """
        self._sends_until = sends_until
        self._first_confirmation = int(is_repetition)
        self._is_accepted_early = is_accepted_early
        self._was_accepted = False  # Early
        self._command = command
        self._route = route
        self._round_trip = round_trip
        self._confirmation = 0
        self._rejections = 0
        self._first_sent_at = self._sent_at = 0.0
        self._deadline = 0.0
        self._asking = False
        self.is_in_progress = False  # The vehicle has answered IN_PROGRESS
        self.outcome: CommandOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Send it for the first time."""
        self._confirmation = self._first_confirmation
        self._first_sent_at = now
        return self._send(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle an answer; other messages are ignored."""
        if self.outcome is None and self._answers(message):
            if self._asking and not self._was_accepted:
                self._sample(now)
            self._settle(message.result, now)
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat it when the answer is overdue."""
        if self.outcome is not None or now < self._deadline:
            return []
        if self._was_accepted:
            self.outcome = Accepted()
            return []
        if now >= self._sends_until:
            self.outcome = EXPIRED
            return []
        if not self._asking:
            return self.start(now)
        if self._confirmation + 1 >= ATTEMPTS:
            self.outcome = Refused(f"no answer to {self._name} after {ATTEMPTS} attempts")
            return []
        self._confirmation += 1
        return self._send(now)

    def _send(self, now: float) -> list[Message]:
        self._asking = True
        self._sent_at = now
        self._deadline = now + self._round_trip.timeout_s
        return [self._command.message(self._route, self._confirmation)]

    def _sample(self, now: float) -> None:
        if self._confirmation == 0:
            self._round_trip.sample(now - self._sent_at)
        else:
            self._round_trip.sample_repeated(now - self._first_sent_at)

    def _answers(self, message: Message) -> bool:
        return (
            message.get_type() == "COMMAND_ACK"
            and message.command == self._command.command
            and self._route.is_for_us(message)
        )

    def _settle(self, result: int, now: float) -> None:
        if self._is_accepted_early and not self._asking:
            return  # It belongs to what was rejected
        if result == mavlink.MAV_RESULT_ACCEPTED:
            self._accept(now)
        elif result == mavlink.MAV_RESULT_IN_PROGRESS:
            self.is_in_progress = True
            self._deadline = now + max(PROGRESS_TIMEOUT_S, self._round_trip.timeout_s)
        elif result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED and self._asking:
            self._reject(result, now)
        elif result != mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
            self.outcome = Refused(self._refusal(result), result)

    def _accept(self, now: float) -> None:
        if self._is_accepted_early and not self._was_accepted:
            self._was_accepted = True
            self._deadline = now + JUDGED_WITHIN_S
        else:
            self.outcome = Accepted()

    def _reject(self, result: int, now: float) -> None:
        self._was_accepted = False
        self._rejections += 1
        if self._rejections >= REJECTIONS:
            self.outcome = Refused(self._refusal(result), result)
        self._asking = False
        self._deadline = now + REJECTION_PAUSE_S

    def _refusal(self, result: int) -> str:
        return f"{self._name} refused: {RESULT_NAMES.get(result, f'MAV_RESULT {result}')}"

    @property
    def _name(self) -> str:
        return mav_cmd_name(self._command.command)


CommandAlternatives: TypeAlias = Sequence[Sequence[Command]]
"""Each alternative is a list of commands that must all be accepted; tried in order."""


class CommandSequence:
    """Sends the first alternative of which every command is accepted.

    When no alternative is left, the outcome is the first refusal: it belongs to the preferred
    alternative.
    """

    def __init__(
        self,
        alternatives: CommandAlternatives,
        route: Route,
        round_trip: RoundTrip,
        *,
        is_repetition: bool = False,
        accepted_early: frozenset[int] = frozenset(),
        sends_until: float = math.inf,
    ) -> None:
        """Prepare the commands.

        Args:
            alternatives: What is sent.
            route: Source and target ids.
            round_trip: Estimate of the link's round trip.
            is_repetition: The vehicle may have received them before.
            accepted_early: MAV_CMDs that the vehicle accepts before it judges them.
            sends_until: From this time [s] on nothing is sent, as they have expired.
        """
        self._sends_until = sends_until
        self._is_repetition = is_repetition
        self._accepted_early = accepted_early
        self._steps = [list(alternative) for alternative in alternatives]
        self._route = route
        self._round_trip = round_trip
        self._running: CommandTransaction | None = None
        self._waits_until: float | None = None
        self._first_refusal: Refused | None = None
        self.alternative = 0  # Index of the alternative that is sent
        self.outcome: CommandOutcome | None = None

    @property
    def is_in_progress(self) -> bool:
        """Whether the vehicle has answered IN_PROGRESS to the latest command."""
        return self._running is not None and self._running.is_in_progress

    def start(self, now: float) -> list[Message]:
        """Start the next command, at first the first one; without any left there is an outcome."""
        if not self._steps:
            self.outcome = self._first_refusal or Refused(
                "this kind of vehicle has no such command"
            )
            return []
        if not self._steps[0]:
            self.outcome = Accepted()
            return []
        if now >= self._sends_until:
            self.outcome = self._first_refusal or EXPIRED
            return []
        command = self._steps[0].pop(0)
        self._running = CommandTransaction(
            command,
            self._route,
            self._round_trip,
            is_repetition=self._is_repetition,
            is_accepted_early=command.command in self._accepted_early,
            sends_until=self._sends_until,
        )
        if command.wait_s > 0.0:
            self._waits_until = now + command.wait_s
            return []
        return self._running.start(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle an answer and send the next command; while it waits, nothing is an answer."""
        if self.outcome is not None or self._running is None or self._waits_until is not None:
            return []
        return [*self._running.receive(message, now), *self._advance(now)]

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue, and send a command that has waited."""
        if self.outcome is not None or self._running is None:
            return []
        if self._waits_until is not None:
            if now < self._waits_until:
                return []
            self._waits_until = None
            return self._running.start(now)
        return [*self._running.tick(now), *self._advance(now)]

    def _advance(self, now: float) -> list[Message]:
        match self._running.outcome if self._running else None:
            case Accepted():
                return self.start(now)
            case Refused() as refusal:
                self._first_refusal = self._first_refusal or refusal
                del self._steps[0]
                self.alternative += 1
                return self.start(now)
            case _:
                return []
