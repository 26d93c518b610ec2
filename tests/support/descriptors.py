"""Descriptors of this process: very many of them, those that stay open, and numbers given again."""

import os
import select
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

import pytest

_SELECT_LIMIT = 1024
"""FD_SETSIZE of glibc: `select` takes no descriptor from here on."""


class _Closable(Protocol):
    def close(self) -> None: ...


@contextmanager
def closed_afterwards(kind: type[_Closable]) -> Iterator[None]:
    """Close each object of a class that is made meanwhile, as the end of a program does it."""
    made: list[_Closable] = []
    initialise = kind.__init__

    def note(self: _Closable, *arguments: Any, **named: Any) -> None:
        initialise(self, *arguments, **named)
        made.append(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kind, "__init__", note)
        yield
    for one in made:
        one.close()


@contextmanager
def many_open_files() -> Iterator[None]:
    """Occupy each descriptor below the limit of `select`."""
    with ExitStack() as opened:
        while (descriptor := os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)) < _SELECT_LIMIT:
            opened.callback(os.close, descriptor)
        opened.callback(os.close, descriptor)
        yield


def open_channels() -> frozenset[str]:
    """Return the sockets and pipes that are open, each by the kernel's name for it."""
    found = set()
    for link in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # The descriptor of this listing, or another thread's
            found.add(str(link.readlink()))
    return frozenset(name for name in found if name.startswith(("socket:", "pipe:")))


@contextmanager
def numbers_given_again() -> Iterator[None]:
    """Give the numbers of closed descriptors to other sockets; fail if one of them gets data."""
    with ExitStack() as opened:
        others = [opened.enter_context(end) for _ in range(32) for end in socket.socketpair()]
        yield
        poll = select.poll()
        for end in others:
            poll.register(end, select.POLLIN)
        assert poll.poll(0) == []
