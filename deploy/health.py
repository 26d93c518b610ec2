"""`python -m deploy.health PROGRAM`: is the program of this container well? 0 yes, 1 no and why.

It asks each program where an outsider can see that it works, not merely that it lives: an HTTP
server for an answer, the relay for its lock and when its loop ran last, or for its database server,
and who speaks MAVLink whether it empties its socket. Only the standard library is loaded, since it
is asked every few seconds.

UnwellError  the program does not do its work; the message says what is wrong
"""

import fcntl
import http.client
import os
import socket
import ssl
import struct
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final, TypeAlias
from urllib.parse import urlsplit

TIMEOUT_S: Final = 4.0
UNREAD_BYTES: Final = 128 * 1024
"""What a program that reads its socket fifty times a second never leaves there."""
STALLED_AFTER_S: Final = 60.0
"""After so long without a turn of its loop a relay hangs, as `/readyz` and the metrics say too."""
_RAN_AT: Final = struct.Struct("=120sd")
"""The note in the relay's lock file: a name, and the monotonic time of the loop's last turn [s]."""
_OK: Final = 200
_UDP_TABLES: Final = (Path("/proc/net/udp"), Path("/proc/net/udp6"))
_TCP_TABLES: Final = (Path("/proc/net/tcp"), Path("/proc/net/tcp6"))
_ESTABLISHED: Final = "01"
_POSTGRES_PORT: Final = 5432
_MAVLINK_PORT: Final = 14540

Environment: TypeAlias = Mapping[str, str]


class UnwellError(Exception):
    """The program does not do its work."""


def ask_http(port: int, path: str, tls: ssl.SSLContext | None = None) -> None:
    """Ask a server on this machine; raises UnwellError unless it answers 200."""
    connection = (
        http.client.HTTPConnection("127.0.0.1", port, timeout=TIMEOUT_S)
        if tls is None
        else http.client.HTTPSConnection("127.0.0.1", port, timeout=TIMEOUT_S, context=tls)
    )
    try:
        connection.request("GET", path)
        status = connection.getresponse().status
    except (OSError, http.client.HTTPException) as error:
        raise UnwellError(f"port {port} does not answer: {error}") from error
    finally:
        connection.close()
    if status != _OK:
        raise UnwellError(f"{path} on port {port} answers {status}")


def connect(port: int) -> None:
    """Connect to a server on this machine; raises UnwellError unless it accepts."""
    try:
        socket.create_connection(("127.0.0.1", port), TIMEOUT_S).close()
    except OSError as error:
        raise UnwellError(f"port {port} does not answer: {error}") from error


def look_at_socket(port: int, tables: tuple[Path, ...] = _UDP_TABLES) -> None:
    """Look at a UDP port (proc(5), net/udp); raises UnwellError if nobody listens or reads."""
    unread = [
        int(row[4].partition(":")[2], 16)
        for row in _rows(tables)
        if int(row[1].rpartition(":")[2], 16) == port
    ]
    if not unread:
        raise UnwellError(f"nobody listens on UDP port {port}")
    if max(unread) > UNREAD_BYTES:
        raise UnwellError(f"{max(unread)} bytes wait unread on UDP port {port}")


def look_at_connection(port: int, tables: tuple[Path, ...] = _TCP_TABLES) -> None:
    """Raise UnwellError unless this container is connected to a port of another (net/tcp)."""
    if not any(
        row[3] == _ESTABLISHED and int(row[2].rpartition(":")[2], 16) == port
        for row in _rows(tables)
    ):
        raise UnwellError(f"there is no connection to port {port}")


def _rows(tables: tuple[Path, ...]) -> Iterator[list[str]]:
    for table in tables:
        if table.exists():
            yield from map(str.split, table.read_text(encoding="ascii").splitlines()[1:])


def look_at_lock(path: Path) -> None:
    """Raise UnwellError unless some process holds the lock on a file."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return
    except OSError as error:
        raise UnwellError(f"{path}: {error.strerror}") from error
    raise UnwellError(f"nobody holds {path}")


def look_at_loop(path: Path) -> None:
    """Raise UnwellError if the relay that holds this lock file has not run its loop for long.

    A relay that hangs keeps its lock. One without a note, as on a full disk, is trusted.
    """
    content = path.read_bytes()[: _RAN_AT.size]
    if len(content) < _RAN_AT.size:
        return
    name, ran_at_s = _RAN_AT.unpack(content)
    passed_s = time.monotonic() - ran_at_s
    if name.rstrip(b"\0") == b"ran_at" and passed_s > STALLED_AFTER_S:
        raise UnwellError(f"its loop has not run for {passed_s:.0f} s")


def _edge_server(environment: Environment) -> None:
    port = int(environment.get("EDGE_PORT") or 8000)
    if environment.get("EDGE_TLS_CLIENT_CA_FILE"):
        connect(port)  # Without a certificate of its own nobody gets an answer
        return
    tls = None
    if environment.get("EDGE_TLS_CERTIFICATE_FILE"):
        # It asks itself over the loopback, where the certificate's name cannot fit.
        tls = ssl._create_unverified_context()  # noqa: S323, SLF001  # as above
    ask_http(port, "/readyz", tls)


def _relay(environment: Environment) -> None:
    if url := environment.get("DATABASE_URL"):
        look_at_connection(urlsplit(url).port or _POSTGRES_PORT)  # Relays share it without a lock
        return
    lock = Path(environment.get("STATE_DIR") or "var") / "edge" / "relay.lock"
    look_at_lock(lock)
    look_at_loop(lock)


def _broker(environment: Environment) -> None:
    """Look where it listens; of one that has lines and connections only, no more can be seen."""
    links = (environment.get("LINKS") or "").replace(",", " ").split()
    default = f"udpin://:{environment.get('MAVLINK_PORT') or _MAVLINK_PORT}"
    for url in map(urlsplit, links or [default]):
        if url.scheme in {"udpin", "udp"}:
            look_at_socket(url.port or _MAVLINK_PORT)


def _vehicle(environment: Environment) -> None:
    base = int(environment.get("VEHICLE_PORT_BASE") or 14580)
    look_at_socket(base + int(environment.get("SYSTEM_ID") or 1))


def _cloud(environment: Environment) -> None:
    ask_http(int(environment.get("CLOUD_PORT") or 8100), "/healthz")


PROGRAMS: Final[Mapping[str, Callable[[Environment], None]]] = {
    "edge-server": _edge_server,
    "relay": _relay,
    "broker": _broker,
    "vehicle": _vehicle,
    "cloud": _cloud,
}


def main(arguments: list[str], environment: Environment) -> int:
    """Ask the one program that is named; gives the exit code, 2 for a name that is none."""
    if len(arguments) != 1 or (check := PROGRAMS.get(arguments[0])) is None:
        print(f"health: name one of {', '.join(PROGRAMS)}", file=sys.stderr)
        return 2
    try:
        check(environment)
    except UnwellError as error:
        print(f"{arguments[0]}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], os.environ))
