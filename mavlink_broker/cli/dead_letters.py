"""`dead-letters`: lists the reports that the edge server never accepted, to retry or drop them.

It reads the state folder only. The broker of that folder carries the actions out: within a second
if it runs, else at its next start.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from farm_flight_bridge import program_name
from mavlink_broker.cli.program import (
    FAILED,
    SUCCEEDED,
    UsageError,
    add_state_dir,
    print_output,
)
from mavlink_broker.database import add_requests
from mavlink_broker.edge.spool import StoredLetter, read_dead_letters

_LIST, _RETRY, _DROP = "list", "retry", "drop"
_SHOWN: Final = 160
"""Characters of a reason in the table."""


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """List dead letters, or request that some are sent again or removed; 1 if one is unknown.

    Raises:
        UsageError: if the state folder cannot be used.
    """
    parser = _parser(environment)
    options = parser.parse_args(arguments)
    folder: Path = options.state_dir / "broker"
    try:
        letters = read_dead_letters(folder)
        if options.action == _LIST:
            _show(letters, as_json=options.json)
            return SUCCEEDED
        known = {letter.number for letter in letters}
        chosen = known if options.all else set(options.numbers)
        if not chosen and not options.all:
            parser.error(f"{options.action}: name numbers, or --all")
        if chosen & known:
            add_requests(folder, options.action, sorted(chosen & known))
    except OSError as error:
        raise UsageError(f"{folder}: {error.strerror}") from error
    result = "sent again" if options.action == _RETRY else "removed"
    print_output(f"{len(chosen & known)} dead letters are {result} by the broker of {folder}")
    for number in sorted(chosen - known):
        print_output(f"there is no dead letter {number}")
    return FAILED if chosen - known else SUCCEEDED


def _show(letters: Sequence[StoredLetter], *, as_json: bool) -> None:
    if as_json:
        print_output(
            json.dumps({"dead_letters": [_record(*letter) for letter in letters]}, indent=1)
        )
        return
    for number, letter in letters:
        post = letter.post
        print_output(
            f"{number}  vehicle {post.vehicle_id}  POST {post.path}  {letter.reason[:_SHOWN]}"
        )
    print_output(f"{len(letters)} dead letters")


def _record(number: int, letter: Any) -> dict[str, Any]:
    post = letter.post
    return {
        "number": number,
        "vehicle_id": post.vehicle_id,
        "path": post.path,
        "idempotency_key": post.idempotency_key,
        "reason": letter.reason,
        "body": post.body,
    }


def _parser(environment: Mapping[str, str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"{program_name('mavlink_broker')} dead-letters",
        description="Reports that the edge server never accepted: list, retry or drop them.",
    )
    parser.add_argument(
        "action",
        nargs="?",
        choices=(_LIST, _RETRY, _DROP),
        default=_LIST,
        help="%(default)s unless given",
    )
    parser.add_argument("numbers", nargs="*", type=int, help="of the dead letters")
    parser.add_argument("--all", action="store_true", help="all of them")
    parser.add_argument("--json", action="store_true", help="as JSON, with bodies")
    add_state_dir(parser, environment)
    return parser
