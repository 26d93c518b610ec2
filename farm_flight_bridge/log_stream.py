"""Log lines to a stream whose reader may stall: a full pipe, a terminal that is paused.

A plain handler would wait for the reader, and with it every thread that logs: a pager that shows
the first page of a log would hold a vehicle's broker. Lines that find no room are lost, and counted
in the log once there is room again.
"""

import logging
import os
import select
import socket
import stat
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Final, TextIO

PATIENCE_S: Final = 0.25
"""How long a line waits for room, unless one before it has waited in vain."""


def standard_error() -> TextIO:
    """Give the standard error; a program that was started without one writes into nothing."""
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115  # as long as the program
    return sys.stderr


class UnblockedStreamHandler(logging.StreamHandler[TextIO]):
    """Writes to a pipe, a terminal or a socket without waiting; to other streams as its base class.

    The stream itself may be used elsewhere, and stays blocking.
    """

    def __init__(self, stream: TextIO) -> None:
        """Write to a stream."""
        super().__init__(stream)
        self.lines_lost = 0
        self._is_line_begun = False
        self._room = select.poll()
        self._opened = ExitStack()
        self._send = self._open(stream)

    def _open(self, stream: TextIO) -> Callable[[bytes], int] | None:
        """Open the stream once more, without blocking; None if that cannot be or needs not be."""
        try:
            descriptor = stream.fileno()
            mode = os.fstat(descriptor).st_mode
            if stat.S_ISSOCK(mode):
                peer = self._opened.enter_context(socket.socket(fileno=os.dup(descriptor)))
                self._room.register(peer, select.POLLOUT)
                return lambda data: peer.send(data, socket.MSG_DONTWAIT)
            if not (stat.S_ISFIFO(mode) or os.isatty(descriptor)):
                return None
            flags = os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY
            own = os.open(f"/proc/self/fd/{descriptor}", flags)
        except OSError:
            return None
        self._opened.callback(os.close, own)
        self._room.register(own, select.POLLOUT)
        return lambda data: os.write(own, data)

    def close(self) -> None:
        """Close what was opened; the stream itself stays open."""
        self._send = None
        self._opened.close()
        super().close()

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line if there is room for it, else count it."""
        if self._send is None:
            super().emit(record)
            return
        try:
            line = self.format(record)
            if self.lines_lost and self._write(self._send, self._end_of_loss(), 0.0):
                self.lines_lost = 0
            patience_s = 0.0 if self.lines_lost else PATIENCE_S
            if self.lines_lost or not self._write(self._send, line, patience_s):
                self.lines_lost += 1
        except Exception:  # noqa: BLE001  # logging's way: the error is printed, the program goes on
            self.handleError(record)

    def _end_of_loss(self) -> str:
        text = "%d lines of the log are lost: its reader had stalled"
        arguments = (self.lines_lost,)
        warning = logging.LogRecord(__name__, logging.WARNING, "", 0, text, arguments, None)
        return self.format(warning)

    def _write(self, send: Callable[[bytes], int], line: str, patience_s: float) -> bool:
        """Write a line as far as there is room; returns whether the whole line is written."""
        data = f"{line}{self.terminator}".encode(errors="backslashreplace")
        if self._is_line_begun:  # A part of one that is lost
            data = self.terminator.encode() + data
        deadline = time.monotonic() + patience_s
        while data:
            try:
                data = data[send(data) :]
                self._is_line_begun = bool(data)
            except BlockingIOError:
                wait_s = deadline - time.monotonic()
                if wait_s <= 0.0 or not self._room.poll(wait_s * 1000.0):
                    return False
        return True
