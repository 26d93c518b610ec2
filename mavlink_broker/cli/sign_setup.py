"""`sign-setup`: loads the signing key of a vehicle into its autopilot, over a cable.

The key is the file `signing-N.key` that the broker signs with; it is made if there is none. With
`--replace` the vehicle gets a new key, signed with the one that it has, and the file changes once
the vehicle signs with it. With `--remove` the vehicle signs no more.
"""

import argparse
import os
import secrets
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final

from farm_flight_bridge import program_name
from mavlink_broker.cli.program import (
    FAILED,
    SUCCEEDED,
    Signals,
    SystemClock,
    UsageError,
    add_state_dir,
    link_errors,
    parse_link,
    print_output,
)
from mavlink_broker.config import DEFAULT_SYSTEM_ID
from mavlink_broker.links.hub import Hub
from mavlink_broker.links.url import Address, LinkKind, LinkUrl
from mavlink_broker.mavlink.codec import Decoder
from mavlink_broker.mavlink.signing import KEY_LENGTH, KeyRing
from mavlink_broker.microservices.signing_setup import Outcome, SigningSetup

_USB: Final = "serial:///dev/ttyACM0:115200"
_WAIT_S: Final = 0.1
_SUCCESSES: Final = frozenset({Outcome.DONE, Outcome.ALREADY})
_ADVICE: Final = {
    Outcome.SILENT: "check the device, the baud rate and the system id",
    Outcome.ARMED: "disarm it",
    Outcome.OTHER_KEY: "name the folder that has its key (--signing-keys), or delete the key on "
    "the vehicle as its manual says",
    Outcome.UNCONFIRMED: "its autopilot may be too old for signatures (PX4 before 1.18), or may "
    "not take keys on this link",
    Outcome.NOT_REMOVED: "its autopilot may not remove keys on this link",
}


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """Load, replace or remove a key; 1 if the vehicle does not take it.

    Raises:
        UsageError: if the link or the folder of keys cannot be used.
    """
    options = _parser(environment).parse_args(arguments)
    link = _link(options.connect, any_link=options.any_link)
    folder: Path = options.signing_keys or options.state_dir / "keys"
    file = folder / f"signing-{options.system}.key"
    draft = file.with_suffix(".key.new")
    try:
        current = _key(folder, options.system, file)
        if options.remove:
            key = None
        elif options.replace:
            key = bytes.fromhex(draft.read_text()) if draft.exists() else _made(draft)
        else:
            key = current or _made(file)
        outcome, texts = _set_up(link, options.system, key, current)
        if options.replace and outcome in _SUCCESSES:
            draft.replace(file)
        elif options.replace and outcome is not Outcome.UNCONFIRMED:
            draft.unlink()
    except OSError as error:
        raise UsageError(f"{error.filename or folder}: {error.strerror}") from error
    if outcome in _SUCCESSES:
        print_output(_success(options, outcome, file))
        return SUCCEEDED
    reported = f" The vehicle reports: {'; '.join(texts)}." if texts else ""
    advice = f"; {_ADVICE[outcome]}" if outcome in _ADVICE else ""
    kept = f" It may have the key of {draft}." if draft.exists() else ""
    sentence = f"vehicle {options.system}: {outcome.value}{advice}.{reported}{kept}"
    print(sentence, file=sys.stderr)
    return FAILED


def _success(options: argparse.Namespace, outcome: Outcome, file: Path) -> str:
    if options.remove:
        return (
            f"vehicle {options.system} signs no more; delete {file}, "
            f"or name the vehicle in UNSIGNED_SYSTEMS"
        )
    already = " already" if outcome is Outcome.ALREADY else ""
    return f"vehicle {options.system} signs{already} with {file}"


def _set_up(
    url: LinkUrl, system: int, key: bytes | None, current: bytes | None
) -> tuple[Outcome, list[str]]:
    """Run the setup until the vehicle has the key, or does not take it."""
    clock, signals, decoder = SystemClock(), Signals(), Decoder()
    setup = SigningSetup(
        system,
        key,
        current_key=current,
        own_system=DEFAULT_SYSTEM_ID,
        utc=clock.utc,
    )
    with link_errors(), closing(Hub()) as hub:
        hub.add(url)
        address: Address | None = None
        while setup.outcome is None:
            if signals.stop:
                raise UsageError("interrupted", signals.status)
            for sender, data in hub.receive(_WAIT_S):
                was_found = setup.found
                for message in decoder.decode(data):
                    setup.receive(message, clock.monotonic())
                if setup.found and not was_found:
                    address = sender
            for frame in setup.step(clock.monotonic()):
                for target in hub.contact_addresses() if address is None else [address]:
                    hub.send(target, frame)
    return setup.outcome, setup.texts()


def _key(folder: Path, system: int, file: Path) -> bytes | None:
    """The key that there is.

    Raises:
        UsageError: if the file is there and is no key that the broker would use.
    """
    key = KeyRing(folder).key_of(system, 0.0)
    if key is None and file.exists():
        raise UsageError(f"{file} is not a key of 32 bytes with mode 600")
    return key


def _made(file: Path) -> bytes:
    """Write a new key; it is on the disk before the vehicle has it."""
    file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    key = secrets.token_bytes(KEY_LENGTH)
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as stream:
        stream.write(key.hex() + "\n")
        stream.flush()
        os.fsync(descriptor)
    return key


def _link(text: str, *, any_link: bool) -> LinkUrl:
    """Read the URL of the cable.

    Raises:
        UsageError: if it is not valid, would carry the key over a network, or is a device that is
            not there: who sets up a vehicle waits for none to be plugged in.
    """
    url = parse_link(text)
    if url.kind is LinkKind.SERIAL:
        try:
            Path(url.host).stat()
        except OSError as error:
            raise UsageError(f"{url.host}: {error.strerror}; plug the cable in") from error
    if url.kind is not LinkKind.SERIAL and not url.is_loopback and not any_link:
        raise UsageError(
            f"{url} would carry the key in the clear over a network; use the cable "
            f"({_USB}), or add --any-link where nobody else listens"
        )
    return url


def _system(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 255:
        raise argparse.ArgumentTypeError(f"a system id is 1 to 255, not {text!r}")
    return int(text)


def _parser(environment: Mapping[str, str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"{program_name('mavlink_broker')} sign-setup",
        description="Load the signing key of a vehicle into its autopilot (PX4, ArduPilot), over "
        "a cable. The vehicle must be disarmed, and no other program may use the cable.",
    )
    parser.add_argument("system", type=_system, metavar="SYSTEM", help="its MAVLink system id")
    parser.add_argument("--connect", metavar="URL", default=_USB, help="the cable: %(default)s")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--replace", action="store_true", help="make a new key for it")
    what.add_argument("--remove", action="store_true", help="remove its key")
    parser.add_argument("--any-link", action="store_true", help="also over a network, in the clear")
    parser.add_argument(
        "--signing-keys",
        type=Path,
        metavar="FOLDER",
        default=Path(environment["SIGNING_KEYS"]) if environment.get("SIGNING_KEYS") else None,
        help="folder of signing-N.key; default: keys in STATE_DIR (environment: SIGNING_KEYS)",
    )
    add_state_dir(parser, environment)
    return parser
