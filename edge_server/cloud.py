"""The cloud over HTTP: the only file that knows its addresses.

One record per request, `POST {cloud}/<kind>`, the bare object with its message_id, the same id
as `Idempotency-Key`, on a connection that is kept alive.
"""

import time
from collections.abc import Callable
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path

import requests
from requests.adapters import HTTPAdapter
from requests.utils import get_environ_proxies

from edge_server.config import Config
from edge_server.outbox.answers import Answer, Reply, Unreachable
from edge_server.outbox.queue import Parcel

MAXIMUM_ANSWER_BYTES = 65_536


class HttpCloud:
    """A CloudPort over one kept-alive connection."""

    def __init__(self, config: Config, *, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._config = config
        self._monotonic = monotonic
        self._session = requests.Session()
        # The environment is asked once; requests would ask it, and .netrc, for every record.
        self._session.trust_env = False
        self._session.proxies.update(get_environ_proxies(config.cloud_url))
        self._session.mount("http://", HTTPAdapter(pool_maxsize=1, max_retries=0))
        self._session.mount("https://", HTTPAdapter(pool_maxsize=1, max_retries=0))

    def deliver(self, parcel: Parcel) -> Reply:
        """Send a record; what the network does becomes an answer or a reason."""
        try:
            with self._session.post(
                f"{self._config.cloud_url}/{parcel.stream.kind}",
                data=parcel.payload.encode(),
                headers=self._headers(parcel),
                timeout=(self._config.connect_timeout_s, self._config.read_timeout_s),
                allow_redirects=False,
                stream=True,
            ) as response:
                return self._read(response)
        except requests.exceptions.SSLError:
            return Unreachable("the cloud's certificate is not accepted")
        except requests.exceptions.ConnectTimeout:
            return Unreachable("no connection in time")
        except requests.exceptions.ReadTimeout:
            return Unreachable("no answer in time")
        except (requests.exceptions.RequestException, OSError) as error:
            return Unreachable(f"no connection ({type(error).__name__})")

    def close(self) -> None:
        """Close the connection."""
        self._session.close()

    def _headers(self, parcel: Parcel) -> dict[str, str]:
        headers = {
            "Content-Type": "application/json",
            "Accept": "application/json",
            "Idempotency-Key": parcel.message_id,
        }
        if self._config.cloud_key_file is not None:
            headers["Authorization"] = f"Bearer {_key(self._config.cloud_key_file)}"
        return headers

    def _read(self, response: requests.Response) -> Reply:
        deadline = self._monotonic() + self._config.read_timeout_s
        body = b""
        for chunk in response.iter_content(16_384):
            body += chunk
            if len(body) > MAXIMUM_ANSWER_BYTES:
                return Unreachable(f"{response.status_code} with an answer that is too long")
            if self._monotonic() > deadline:
                return Unreachable("the answer took too long")
        return Answer(
            response.status_code,
            response.headers.get("Content-Type", ""),
            body,
            retry_after_s(response.headers.get("Retry-After"), datetime.now(UTC)),
        )


def retry_after_s(header: str | None, now: datetime) -> float | None:
    """Read a Retry-After header, seconds or a date (RFC 9110 section 10.2.3)."""
    if header is None:
        return None
    text = header.strip()
    if text.isascii() and text.isdigit():
        return float(text)
    try:
        moment = parsedate_to_datetime(text)
    except ValueError:
        return None
    if moment.tzinfo is None:
        return None
    return max((moment - now).total_seconds(), 0.0)


def _key(path: Path) -> str:
    """The key is read for each record: it may be replaced while we run."""
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return ""
