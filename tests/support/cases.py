"""One test over many cases of a pure function, with every failing case named."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def failures(check: Callable[..., None], cases: Iterable[tuple[Any, ...]]) -> list[str]:
    """Call a check with the arguments of every case and collect the failures.

    Returns:
        One text for each case that fails: its arguments and the failed assertion.

    Raises:
        Exception: Any error of the check that is not a failed assertion, with a note that
            names the case.

    """
    found = []
    for case in cases:
        name = f"{case!r:.200}"
        try:
            check(*case)
        except (AssertionError, pytest.fail.Exception) as failure:
            found.append(f"{name}: {failure}")
        except Exception as error:
            error.add_note(f"in the case {name}")
            raise
    return found
