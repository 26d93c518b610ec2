"""A process with so many open files that every new descriptor has a number above 1023."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

_SELECT_LIMIT = 1024
"""FD_SETSIZE of glibc: `select` takes no descriptor from here on."""


@contextmanager
def many_open_files() -> Iterator[None]:
    """Occupy each descriptor below the limit of `select`."""
    with ExitStack() as opened:
        while (descriptor := os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)) < _SELECT_LIMIT:
            opened.callback(os.close, descriptor)
        opened.callback(os.close, descriptor)
        yield
