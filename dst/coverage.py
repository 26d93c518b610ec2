"""Which transitions, refusals and answers a run has reached: what it cannot have judged is missing.

A law that holds says little about what was never tried. The counters are printed at the end of
`make dst`; they change nothing of what is simulated.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final
from unittest.mock import patch

from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post
from mavlink_broker.mission import mission_executor
from mavlink_broker.mission.states import TRANSITIONS, Event, State, follow

_TRANSITION: Final = "transition"
_REFUSAL: Final = "refusal"
_ANSWER: Final = "answer"
_NUMBERS: Final = re.compile(r"\d[\d.]*")
_KINDS: Final = {_REFUSAL: "refusals of the broker", _ANSWER: "answers of the edge server"}


class Coverage:
    """Counts what one simulation reaches."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count the transitions of every mission of the broker."""

        def counted(state: State, event: Event) -> State:
            after = follow(state, event)
            self.counts[_transition(state, event)] += 1
            return after

        with patch.object(mission_executor, "follow", counted):
            yield

    def note_answer(self, post: Post, answer: Answer) -> None:
        """Count an answer of the edge server, and the refusal that a post reports."""
        path = _NUMBERS.sub("N", post.path)
        self.counts[f"{_ANSWER} {post.method} {path} {answer.status_code}"] += 1
        if post.body.get("status") == "refused":
            message = _NUMBERS.sub("N", str(post.body.get("message", "")))
            self.counts[f"{_REFUSAL} {message}"] += 1


def _transition(state: State, event: Event) -> str:
    return f"{_TRANSITION} {state.name} --{event.name}--> {TRANSITIONS[state, event].name}"


def text_of(counts: Mapping[str, int]) -> str:
    """Describe what was reached, and the transitions that were not."""
    every = [_transition(*key) for key in TRANSITIONS]
    missed = sorted(name.partition(" ")[2] for name in every if not counts.get(name))
    lines = [f"{len(every) - len(missed)} of {len(every)} transitions of a mission; not reached:"]
    lines += [f"  {name}" for name in missed]
    for kind, title in _KINDS.items():
        found = sorted((count, name) for name, count in counts.items() if name.startswith(kind))
        lines.append(f"{len(found)} {title}:")
        lines += [f"{count:8} {name.partition(' ')[2]}" for count, name in reversed(found)]
    return "\n".join(lines)
