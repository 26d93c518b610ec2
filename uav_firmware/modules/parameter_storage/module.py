"""Loads stored parameters at start; saves changes on request and at 1 Hz, without blocking."""

import json
from collections.abc import Callable
from typing import Final

from uav_firmware.bus import Queue
from uav_firmware.cal.storage import Storage, Write
from uav_firmware.msg.status import (
    ParameterSaveRequest,
    ParameterSaveResult,
    Severity,
    StatusText,
)
from uav_firmware.parameters import Registry

FILE_NAME: Final = "parameters.json"
_FINISH_S: Final = 2.0  # [s] A parameter file is a few kilobytes


class ParameterStorageModule:
    """Stores one JSON object of name to value, of the values that differ from their defaults."""

    def __init__(
        self,
        storage: Storage,
        *,
        registry: Registry,
        save_request: Queue[ParameterSaveRequest],
        save_result: Queue[ParameterSaveResult],
        status_text: Queue[StatusText],
        time_us: Callable[[], int],
    ) -> None:
        """Load the stored values; each one that no longer fits becomes a warning."""
        self._storage = storage
        self._registry = registry
        self._save_request = save_request
        self._save_result = save_result
        self._status_text = status_text
        self._time_us = time_us
        self._failed = False
        self._write: Write | None = None
        self._writing_version = 0
        for fault in self._load():
            self._warn(fault)
        self._saved_version = registry.version

    def update(self) -> None:
        """Start to save changes; a failed save is retried at the next call."""
        if self._write is None or self._write.done():
            self._try_save()

    def serve_requests(self) -> None:
        """Start to save for each request, and answer it without waiting for the write."""
        for request in self._save_request.drain():
            fault = ""
            try:
                self._save()
            except OSError as error:
                fault = _text(error)
            self._save_result.publish(ParameterSaveResult(request.request_id, fault))

    def finish(self) -> str:
        """Save unsaved changes and wait for the write; called at shutdown.

        A failed save is retried once. Waits at most `_FINISH_S` per write. Returns an error text,
        empty on success.
        """
        try:
            if self._write is not None:
                self._await(self._write)
            self._save()
            if self._write is not None:
                self._write.result(_FINISH_S)
                self._check_write()
        except OSError as error:
            return f"Parameters not saved: {_text(error)}"
        return ""

    def _await(self, write: Write) -> None:
        """Wait for a write; a failed one is dropped, so that `_save` starts it again.

        Raises:
            TimeoutError: if it does not end within `_FINISH_S`.
        """
        try:
            write.result(_FINISH_S)
        except OSError:
            if not write.done():
                raise
            self._write = None

    def _try_save(self) -> None:
        """Start to save changes; warn once when it fails."""
        try:
            self._save()
        except OSError as error:
            if not self._failed:
                self._warn(f"Parameters not saved: {_text(error)}")
            self._failed = True

    def _save(self) -> None:
        """Start to save now, after any write in progress.

        Raises:
            OSError: if this write cannot start, or the last one failed; the stored values stay.
        """
        self._check_write()
        version = self._registry.version
        if version == (self._saved_version if self._write is None else self._writing_version):
            return
        contents = json.dumps(self._registry.changed(), indent=2, sort_keys=True) + "\n"
        self._write = self._storage.save(FILE_NAME, contents.encode())
        self._writing_version = version
        self._check_write()

    def _check_write(self) -> None:
        """Collect the result of the last write if it has ended.

        Raises:
            OSError: if it failed.
        """
        write = self._write
        if write is None or not write.done():
            return
        self._write = None
        write.result()
        self._saved_version = self._writing_version
        self._failed = False

    def _load(self) -> list[str]:
        try:
            contents = self._storage.load(FILE_NAME)
            stored = {} if contents is None else json.loads(contents)
        except (OSError, ValueError) as error:
            return [f"Parameters not loaded: {error}"]
        if not isinstance(stored, dict):
            return ["Parameters not loaded: the file contains no JSON object"]
        numbers = {name: value for name, value in stored.items() if _is_number(value)}
        faults = [f"{name}: {stored[name]!r} is not a number" for name in stored.keys() - numbers]
        return faults + self._registry.load(numbers)

    def _warn(self, text: str) -> None:
        self._status_text.publish(StatusText(self._time_us(), Severity.WARNING, text))


def _text(error: OSError) -> str:
    return error.strerror or str(error) or "the storage does not answer"


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
