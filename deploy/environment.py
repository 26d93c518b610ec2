"""Makes the virtual environment that the Makefile works in, and says in one sentence what prevents.

    python3 -m deploy.environment make FOLDER     makes it, or again where it is half made
    FOLDER/bin/python -m deploy.environment index checks that pip reaches its package index

It needs the standard library only, since nothing is installed when it runs.
"""

import argparse
import subprocess
import sys
import venv
from importlib.util import find_spec
from pathlib import Path
from typing import Final

INDEX_TIMEOUT_S: Final = 4.0
"""Of a connection, and of an answer; the whole check takes at most twice as long."""
_LOCKED_PACKAGE: Final = "pydantic"


class EnvironmentMakingError(Exception):
    """The environment cannot be made; one sentence says why and what to do."""


def make(folder: Path) -> None:
    """Make the environment, in place of what an interrupted attempt has left.

    Raises:
        EnvironmentMakingError: without the parts of Python that it takes.
    """
    if find_spec("ensurepip") is None:
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise EnvironmentMakingError(
            f"Python {version} is without its module ensurepip: "
            f"apt-get install python3-venv (or python{version}-venv), then run make again"
        )
    venv.create(folder, clear=True, with_pip=True)


def check_index(timeout_s: float = INDEX_TIMEOUT_S) -> None:
    """Check that the package index of pip's configuration answers.

    Raises:
        EnvironmentMakingError: if it does not.
    """
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input"]
    patience = ["--retries", "0", "--timeout", f"{timeout_s:g}"]
    try:
        answer = subprocess.run(  # noqa: S603  # pip itself
            [*pip, "index", "versions", *patience, _LOCKED_PACKAGE],
            capture_output=True,
            text=True,
            timeout=2.0 * timeout_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        reason = f"no answer within {2.0 * timeout_s:g} s"
    else:
        if not answer.returncode:
            return
        reason = (answer.stderr.strip().splitlines() or ["no reason given"])[-1]
    raise EnvironmentMakingError(
        f"the package index cannot be reached ({reason}): "
        "connect to a network, or name an index (pip config set global.index-url URL)"
    )


def main(arguments: list[str]) -> int:
    """Make or check; 1 with a sentence if that fails."""
    parser = argparse.ArgumentParser(
        prog="deploy.environment", description="Make the virtual environment of make."
    )
    actions = parser.add_subparsers(dest="action", required=True)
    making = actions.add_parser("make", help="make the environment")
    making.add_argument("folder", type=Path, help="where; what is there is replaced")
    actions.add_parser("index", help="check that the package index answers")
    options = parser.parse_args(arguments)
    try:
        make(options.folder) if options.action == "make" else check_index()
    except EnvironmentMakingError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
