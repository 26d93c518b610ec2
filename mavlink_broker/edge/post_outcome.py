"""What the answer to a post means: settled, sent before, withdrawn, refused, or to be sent again.

ForeignAnswerError  somebody else answered in the place of the edge server
"""

import logging
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final, Self

import requests

from mavlink_broker.edge.bounded_http import (
    Answer,
    cause_of,
    explain,
    is_final,
    is_temporary_refusal,
)
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.wire import VEHICLE_LANE, AcceptanceResult, is_acknowledgement

MAX_LOGGED_CHARACTERS: Final = 500
"""Of a refusal's text."""
KNOWN: Final = "Idempotency-Key was used"
"""The edge server's refusal of another body under a key that it has received before."""

_WITHDRAWN: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.GONE})
"""Answers to an acknowledgement of work that is cancelled, expired or ended."""
_REFUSALS: Final = HTTPStatus.BAD_REQUEST
"""Status codes from here on."""
_LOG = logging.getLogger(__name__)


class ForeignAnswerError(requests.RequestException):
    """Somebody else answered in the place of the edge server."""


@dataclass(frozen=True, slots=True)
class PostOutcome:
    """The answer to a post, or why there was none."""

    post: Post
    status: int | None  # None: there was no answer
    text: str  # Names field and reason of a refusal, in words
    is_settled: bool = False  # The edge server's own answer, which a repetition would get again

    @classmethod
    def of(cls, post: Post, answer: Answer | Exception, *, is_own: bool) -> Self:
        """Judge an answer; `is_own` if it is the edge server's, as of `examined`."""
        if isinstance(answer, Exception):
            return cls(post, None, cause_of(answer)[:MAX_LOGGED_CHARACTERS])
        status, text = answer.status_code, explain(answer)[:MAX_LOGGED_CHARACTERS]
        return cls(post, status, text, is_own and is_final(status))

    @property
    def reason(self) -> str:
        """Why the post was not taken."""
        if self.status is None:
            return self.text
        return f"HTTP {self.status}: {self.text}" if self.text else f"HTTP {self.status}"

    @property
    def is_temporary(self) -> bool:
        """Whether it is refused until a condition outside the request changes."""
        return self.status is not None and is_temporary_refusal(self.status)

    @property
    def loses_nothing(self) -> bool:
        """Whether no data is lost: a success, or a refusal of known or ended work.

        An acknowledgement of work that the edge server has withdrawn or closed has no effect.
        """
        return self._is_success or self._was_sent_before or self._is_withdrawn

    @property
    def acceptance_result(self) -> AcceptanceResult | None:
        """What the last answer to an acceptance means; None for any other post."""
        work_id = self.post.accepted_work_id
        if work_id is None:
            return None
        if self._is_success:
            return AcceptanceResult(work_id, is_confirmed=True)
        if self.status in _WITHDRAWN:
            return AcceptanceResult(work_id, is_confirmed=False, reason=self.text)
        reason = f"the edge server did not confirm the acceptance: {self.reason}"
        return AcceptanceResult(work_id, is_confirmed=False, reason=reason, has_failed=True)

    def log_refusal(self) -> None:
        """Log a final answer, if it is a refusal."""
        what, why = _name_of(self.post), self.reason
        if self._is_success:
            return
        if self._was_sent_before:
            _LOG.info("%s was sent before", what)
        elif self._is_withdrawn:
            _LOG.warning("%s is not accepted: %s", what, why)
        elif self.post.is_inherited:
            _LOG.warning("%s, by an earlier run, is refused: %s", what, why)
        else:
            _LOG.error("%s is refused: %s", what, why)

    def log_given_up(self) -> None:
        """Log that the post is not sent again."""
        by_whom = ", by an earlier run," if self.post.is_inherited else ""
        _LOG.error("%s%s is given up: %s", _name_of(self.post), by_whom, self.reason)

    @property
    def _is_success(self) -> bool:
        return self.status is not None and self.status < _REFUSALS

    @property
    def _was_sent_before(self) -> bool:
        is_refused_body = self.status == HTTPStatus.UNPROCESSABLE_ENTITY
        return self.post.may_be_duplicate and is_refused_body and KNOWN in self.text

    @property
    def _is_withdrawn(self) -> bool:
        return is_acknowledgement(self.post) and self.status in _WITHDRAWN


def _name_of(post: Post) -> str:
    """Name a post as an operator knows it."""
    if is_acknowledgement(post):
        status, work_id = post.body["status"], post.path.split("/")[3]
        return f'the answer "{status}" of vehicle {post.vehicle_id} to work {work_id}'
    if post.lane == VEHICLE_LANE:
        return f"the state of vehicle {post.vehicle_id}"
    return f"the {post.path.strip('/').replace('_', ' ')} of vehicle {post.vehicle_id}"


def examined(answer: Answer | Exception) -> tuple[Answer | Exception, bool]:
    """Give an answer, and whether it is the edge server's: its answers are JSON objects.

    A success or redirection of somebody else becomes an error.
    """
    if isinstance(answer, Exception):
        return answer, False
    try:
        if isinstance(answer.json(), dict):
            return answer, True
    except requests.RequestException as error:
        _LOG.debug("an answer is not JSON: %s", error)
    if answer.status_code >= _REFUSALS:
        return answer, False
    return ForeignAnswerError(f"HTTP {answer.status_code} is not of the edge server"), False
