"""`python -m deploy.secret_files FOLDER`: make every secret that the containers need, once.

A file that is there already stays as it is, so a second run adds only what is missing; with
`--replace NAME` that one is made anew. Each file belongs to the user whose program reads it and
to nobody else: a container's secret is a file of the host, mounted with its owner and mode.
"""

import argparse
import base64
import hashlib
import os
import secrets
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from edge_server.store.rows import keys
from edge_server.store.rows.keys import Role

PROGRAM_USER: Final = 10001
"""Whom our images run as."""
MOSQUITTO_USER: Final = 1883
SIGNING_KEY_BYTES: Final = 32
_MODE: Final = 0o400
_ROUNDS: Final = 210_000
"""PBKDF2-HMAC-SHA512, as OWASP advises (Password Storage Cheat Sheet, 2023)."""
_SALT_BYTES: Final = 12

Makers = Mapping[str, Callable[[], str]]


def makers(folder: Path, vehicles: int) -> Makers:
    """How each file is made, in an order in which what a later one needs is there."""
    made: dict[str, Callable[[], str]] = {f"{role.value}.key": keys.generate for role in Role}
    for system_id in range(1, vehicles + 1):
        made[f"signing-{system_id}.key"] = _signing_key
    made["uplink.key"] = lambda: f"farm:{secrets.token_hex(32)}"
    made["cloud-mqtt.key"] = lambda: f"cloud:{secrets.token_hex(32)}"
    made["mosquitto.passwd"] = lambda: "\n".join(
        mosquitto_line((folder / name).read_text(encoding="ascii").strip())
        for name in ("uplink.key", "cloud-mqtt.key")
    )
    made["postgres.password"] = lambda: secrets.token_hex(32)
    made["pgpass"] = lambda: (
        "*:*:*:*:" + (folder / "postgres.password").read_text(encoding="ascii").strip()
    )
    return made


def mosquitto_line(login: str) -> str:
    """Write `user:password` as a line of Mosquitto's password file (mosquitto_passwd(1))."""
    user, _, password = login.partition(":")
    salt = secrets.token_bytes(_SALT_BYTES)
    digest = hashlib.pbkdf2_hmac("sha512", password.encode(), salt, _ROUNDS)
    parts = (base64.b64encode(part).decode() for part in (salt, digest))
    return f"{user}:$7${_ROUNDS}$" + "$".join(parts)


def prepare(folder: Path, vehicles: int, replace: frozenset[str] = frozenset()) -> list[str]:
    """Make what is missing, and what is to be replaced; gives the names of what was made.

    Raises:
        OSError: if the folder or a file cannot be written.
        ValueError: if `replace` names what is no secret of ours.
    """
    known = makers(folder, vehicles)
    if unknown := replace - known.keys():
        raise ValueError(f"there is no secret {', '.join(sorted(unknown))}")
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    made = []
    for name, make in known.items():
        path = folder / name
        if name in replace or not path.exists():
            _write(path, make())
            made.append(name)
    return made


def _signing_key() -> str:
    return secrets.token_hex(SIGNING_KEY_BYTES)


def _write(path: Path, text: str) -> None:
    """Write a file in one step; as root, for the user whose program reads it."""
    draft = path.with_name(path.name + ".new")
    draft.unlink(missing_ok=True)
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _MODE)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(text + "\n")
        file.flush()
        os.fsync(descriptor)
        if os.geteuid() == 0:
            owner = MOSQUITTO_USER if path.name == "mosquitto.passwd" else PROGRAM_USER
            os.fchown(descriptor, owner, owner)
    draft.replace(path)


def main(arguments: list[str]) -> int:
    """Make the files; gives the exit code."""
    parser = argparse.ArgumentParser(
        prog="deploy.secret_files",
        description="Make every secret that the containers need and that is not there yet.",
    )
    parser.add_argument("folder", type=Path, help="where the secrets are")
    parser.add_argument("--vehicles", type=int, default=2, help="how many signing keys (2)")
    parser.add_argument("--replace", action="append", default=[], help="a file to make anew")
    options = parser.parse_args(arguments)
    try:
        made = prepare(options.folder, options.vehicles, frozenset(options.replace))
    except (OSError, ValueError) as error:
        print(f"secret_files: {error}", file=sys.stderr)
        return 1
    print(f"made {', '.join(made)}" if made else "every secret is there already")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
