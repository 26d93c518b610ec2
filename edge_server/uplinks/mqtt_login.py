"""Who we are to the broker: `user:password` in a file that only its owner may read.

LoginError  a file that says who we or they are cannot be used; never says what is in it
"""

import logging
import os
import stat
from pathlib import Path
from secrets import token_hex
from typing import Final, NamedTuple

LOG = logging.getLogger(__name__)
MAXIMUM_LOGIN_BYTES: Final = 32_768


class LoginError(Exception):
    """A file with user and password, or with certificates, cannot be used."""


class Login(NamedTuple):
    """What the broker asks for."""

    user: str
    password: str


def read_login(path: Path) -> Login:
    """Read user and password, anew for each connection: they may be replaced while we run.

    Raises:
        LoginError: if the file cannot be read, is open to others, or holds no `user:password`.
    """
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            text = file.read(MAXIMUM_LOGIN_BYTES + 1).decode().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise LoginError(f"{path.name} cannot be read ({type(error).__name__})") from None
    if stat.S_IMODE(mode) & 0o077:
        raise LoginError(f"{path.name} is open to others: chmod 600 it")
    user, colon, password = text.partition(":")
    if not user or not colon or len(text) > MAXIMUM_LOGIN_BYTES:
        raise LoginError(f"{path.name} does not hold user:password")
    return Login(user, password)


def own_client_id(path: Path) -> str:
    """Give this gateway's name, drawn once and kept in the state folder.

    Two gateways of one name would throw each other out of the broker for ever.
    """
    try:
        kept = path.read_text(encoding="ascii").strip()
    except (FileNotFoundError, UnicodeDecodeError):
        kept = ""
    if kept.isalnum():
        return kept
    drawn = f"edge{token_hex(8)}"  # Up to 23 letters and digits suit every broker
    try:
        path.write_text(f"{drawn}\n", encoding="ascii")
    except OSError as error:
        LOG.warning("our name at the broker lasts for this run only: %s", error)
    return drawn
