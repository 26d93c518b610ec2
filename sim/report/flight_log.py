"""What the vehicle logged: one or several ULog files of one run as one log."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no types

from sim.report.arrays import Array, ReportError

_SECONDS_PER_MICROSECOND = 1e-6


@dataclass(frozen=True, slots=True)
class Text:
    """A STATUSTEXT."""

    time_s: float
    severity: int  # [-] 0 emergency to 7 debug
    text: str


@dataclass(frozen=True, slots=True)
class FlightLog:
    """Topics by name; each is a table of columns, `time_s` since boot among them."""

    topics: dict[str, dict[str, Array]]
    texts: list[Text] = field(default_factory=list)

    def time_s(self, topic: str) -> Array:
        """Times of a topic's rows."""
        return self.column(topic, "time_s")

    def column(self, topic: str, name: str) -> Array:
        """One column.

        Raises:
            ReportError: if the log lacks it.
        """
        try:
            return self.topics[topic][name]
        except KeyError:
            raise ReportError(f"the flight log lacks {topic}.{name}") from None

    def columns(self, topic: str, *names: str) -> Array:
        """Several columns side by side."""
        return np.stack([self.column(topic, name) for name in names], axis=1)

    def array(self, topic: str, name: str, length: int) -> Array:
        """An array field, one column per element."""
        return self.columns(topic, *(f"{name}[{index}]" for index in range(length)))


def read_logs(paths: Sequence[Path]) -> FlightLog:
    """Read the logs of one run of one vehicle, in order of time.

    Raises:
        ReportError: if there is none, or one cannot be read.
    """
    if not paths:
        raise ReportError("the vehicle has logged no flight")
    topics: dict[str, dict[str, list[Array]]] = {}
    texts = []
    for log in [_open(path) for path in paths]:
        for dataset in log.data_list:
            table = topics.setdefault(dataset.name, {})
            for name, values in dataset.data.items():
                table.setdefault(name, []).append(np.asarray(values, dtype=np.float64))
        texts += [
            Text(
                entry.timestamp * _SECONDS_PER_MICROSECOND,
                entry.log_level - ord("0"),
                entry.message,
            )
            for entry in log.logged_messages
        ]
    return FlightLog({name: _joined(table) for name, table in topics.items()}, texts)


def _open(path: Path) -> ULog:
    try:
        return ULog(io.BytesIO(path.read_bytes()))
    except Exception as error:  # pyulog raises bare Exception subclasses and struct.error alike
        raise ReportError(f"{path} holds no flight log: {error}") from error


def _joined(table: dict[str, list[Array]]) -> dict[str, Array]:
    columns = {name: np.concatenate(parts) for name, parts in table.items()}
    columns["time_s"] = columns.pop("timestamp") * _SECONDS_PER_MICROSECOND
    return columns
