"""The cloud over HTTP: the only file that knows its addresses.

One record per request: `POST {cloud}/<kind>`, the bare object with its message_id, the same id as
`Idempotency-Key`, on connections that are kept alive. Many records per request if the cloud
accepts it: an answer with `Accept-Batch: 100` states that `POST {cloud}/batch` takes up to so many,
one JSON object per line, `{"kind": "pose", "record": {...}}`, and answers with
`{"results": [{"message_id": ..., "status": 200}, ...]}`, one result per line in its order.
"""

import http.client
import io
import logging
import ssl
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Final

import requests
import urllib3
from requests.utils import get_environ_proxies

from edge_server.config import Config
from edge_server.outbox.answers import Answer, Outcome, Reply, Unreachable, classify
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.outbox.uplink import HELD_BACK, MAXIMUM_BATCH, ONE_BY_ONE, BatchLimit
from edge_server.uplinks import batches, tls_failures
from edge_server.uplinks.bounded_http import PinnedAdapter

MAXIMUM_ANSWER_BYTES: Final = 65_536
_BATCH_REFUSED: Final = batches.REFUSED | {411}  # No length: HTTP's own
_BODILESS: Final = frozenset({204, 205, 304})
_FAILURES: Final = (
    requests.exceptions.RequestException,
    urllib3.exceptions.HTTPError,
    http.client.HTTPException,
    OSError,
    ValueError,
)
"""What requests raises because of the network, or of a server that violates HTTP.

`response.raw` raises urllib3's errors, not those of requests, and http.client's where a header
cannot be read. A ValueError is a header or an address that cannot be decoded.
"""


# It logs a traceback for each header that it cannot read; our own lines give the reason
logging.getLogger("urllib3").setLevel(logging.ERROR)


class HttpUplink:
    """An Uplink with one kept-alive connection per thread."""

    def __init__(self, config: Config, *, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._config = config
        self._monotonic = monotonic
        self._batch_limit = ONE_BY_ONE
        self._no_batches_until = float("-inf")
        self._mine = threading.local()
        self._sessions: list[requests.Session] = []

    def batch_limit(self) -> BatchLimit:
        """Return what the cloud has stated, single records until it has."""
        return self._batch_limit if self._monotonic() >= self._no_batches_until else ONE_BY_ONE

    def send(self, records: Sequence[OutboxRecord]) -> list[Reply]:
        """Send records; whatever the network does becomes an answer or a reason."""
        if len(records) == 1:
            return [self._post_one(records[0])]
        answer = self._post("batch", batches.write(records), batches.MEDIA_TYPE, {})
        if isinstance(answer, Answer) and answer.status in _BATCH_REFUSED:
            replies = None
        else:
            replies = batches.read(answer, records)
        if replies is not None:
            return replies
        self._no_batches_until = self._monotonic() + batches.NO_BATCHES_S
        return self._send_one_by_one(records)

    def close(self) -> None:
        """Close the connections."""
        for session in self._sessions:
            session.close()

    def _send_one_by_one(self, records: Sequence[OutboxRecord]) -> list[Reply]:
        """Send the records of a batch singly, each after the one before it was delivered."""
        replies: list[Reply] = []
        waiting: set[Stream] = set()
        unreachable: Unreachable | None = None
        for record in records:
            if record.stream in waiting:
                replies.append(HELD_BACK)
                continue
            reply = unreachable or self._post_one(record)
            replies.append(reply)
            if isinstance(reply, Unreachable):
                unreachable = reply
            if classify(reply).outcome not in {Outcome.CONFIRMED, Outcome.REJECTED}:
                waiting.add(record.stream)
        return replies

    def _post_one(self, record: OutboxRecord) -> Reply:
        key = {"Idempotency-Key": record.message_id}
        return self._post(record.stream.kind, record.payload.encode(), "application/json", key)

    def _post(self, place: str, body: bytes, media_type: str, headers: Mapping[str, str]) -> Reply:
        try:
            with self._session().post(
                f"{self._config.cloud_url}/{place}",
                data=io.BytesIO(body),  # Sent in pieces, each with the whole timeout
                headers={**self._headers(media_type), **headers},
                timeout=(self._config.connect_timeout_s, self._config.read_timeout_s),
                allow_redirects=False,
                stream=True,
            ) as response:
                return self._read(response)
        except _FAILURES as error:
            return Unreachable(_reason(error))

    def _session(self) -> requests.Session:
        """The connection of this thread."""
        session: requests.Session | None = getattr(self._mine, "session", None)
        if session is None:
            session = self._mine.session = self._new_session()
            self._sessions.append(session)
        return session

    def _new_session(self) -> requests.Session:
        session = requests.Session()
        # The environment is read once; requests would read it, and .netrc, for every record.
        session.trust_env = False
        session.proxies.update(get_environ_proxies(self._config.cloud_url))
        if self._config.cloud_ca_file is not None:
            session.verify = str(self._config.cloud_ca_file)
        if self._config.cloud_client_certificate_file is not None:
            session.cert = str(self._config.cloud_client_certificate_file)
        for scheme in ("http://", "https://"):
            session.mount(scheme, PinnedAdapter(self._config.cloud_fingerprint))
        return session

    def _headers(self, media_type: str) -> dict[str, str]:
        headers = {
            "Content-Type": media_type,
            "Accept": "application/json",
            "Accept-Encoding": "identity",  # A small answer must not unpack into a large one
        }
        if self._config.cloud_key_file is not None:
            headers["Authorization"] = f"Bearer {_key(self._config.cloud_key_file)}"
        return headers

    def _read(self, response: requests.Response) -> Reply:
        body = b""
        for chunk in response.raw.stream(16_384, decode_content=False):
            body += chunk
            if len(body) > MAXIMUM_ANSWER_BYTES:
                return Unreachable(f"{response.status_code} with an answer that is too long")
        if not body and not _is_complete(response):
            return Unreachable(f"{response.status_code} with an answer that may be cut off")
        answer = Answer(
            response.status_code,
            response.headers.get("Content-Type", ""),
            body,
            retry_after_s(response.headers.get("Retry-After"), datetime.now(UTC)),
        )
        if classify(answer).outcome is Outcome.CONFIRMED:
            if body and not _is_plain(response):
                return Unreachable(f"{response.status_code} in an encoding that was not requested")
            self._batch_limit = read_accept_batch(response.headers.get("Accept-Batch"))
        return answer


def _reason(error: Exception) -> str:
    """Describe the failure with the same text for every record that meets it."""
    causes = _causes(error)
    failures = [one for one in causes if isinstance(one, ssl.SSLError)]
    if failures:
        return tls_failures.describe("the cloud", failures[0])
    if any(isinstance(one, requests.exceptions.SSLError) for one in causes):  # By its fingerprint
        return "the cloud's certificate is not accepted"
    if any(isinstance(one, requests.exceptions.ConnectTimeout) for one in causes):
        return "no connection in time"
    if any(isinstance(one, _TOO_LATE) for one in causes):
        return "no answer in time"
    if any(isinstance(one, _INCOMPLETE) for one in causes):
        return f"the answer is cut off or broken ({type(error).__name__})"
    return f"no connection ({type(error).__name__})"


_TOO_LATE: Final = (
    requests.exceptions.Timeout,
    urllib3.exceptions.ReadTimeoutError,
    TimeoutError,
)
_INCOMPLETE: Final = (
    http.client.HTTPException,
    urllib3.exceptions.ProtocolError,
    urllib3.exceptions.DecodeError,
    requests.exceptions.ChunkedEncodingError,
    requests.exceptions.ContentDecodingError,
)


def _causes(error: BaseException | None) -> list[BaseException]:
    """Return an error and what it was raised from."""
    found: list[BaseException] = []
    while error is not None and error not in found:
        found.append(error)
        error = error.__cause__ or error.__context__
    return found


def _is_complete(response: requests.Response) -> bool:
    """Whether an empty body is complete; unframed, a cut after the headers looks the same."""
    framed = {"Content-Length", "Transfer-Encoding"} & {name.title() for name in response.headers}
    return bool(framed) or response.status_code in _BODILESS


def _is_plain(response: requests.Response) -> bool:
    """Whether the body is as it was sent: we accept no encoding, so another label is wrong."""
    encoding = response.headers.get("Content-Encoding", "").strip().lower()
    return encoding in {"", "identity"}


def read_accept_batch(header: str | None) -> BatchLimit:
    """Read an Accept-Batch header, a number of records; anything else means single records."""
    text = (header or "").strip()
    if not (text.isascii() and text.isdigit() and len(text) < 7):
        return ONE_BY_ONE
    records = min(int(text), MAXIMUM_BATCH.records)
    return BatchLimit(records, MAXIMUM_BATCH.size_bytes) if records > 1 else ONE_BY_ONE


def retry_after_s(header: str | None, now: datetime) -> float | None:
    """Read a Retry-After header, seconds or a date (RFC 9110 section 10.2.3)."""
    if header is None:
        return None
    text = header.strip()
    if text.isascii() and text.isdigit():
        return float(text[:9])
    try:
        moment = parsedate_to_datetime(text)
    except (ValueError, OverflowError):
        return None
    if moment.tzinfo is None:
        return None
    return max((moment - now).total_seconds(), 0.0)


def _key(path: Path) -> str:
    """Read the key; it is read for each record, since it may be replaced while the relay runs."""
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return ""
