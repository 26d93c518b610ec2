"""The databases of these tests are closed behind each test, as the end of a program does it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from mavlink_broker.database import Database


@pytest.fixture(autouse=True)
def _no_open_databases(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A broker that is killed closes nothing: what its test leaves open would stay so."""
    made: list[Database] = []
    initialise = Database.__init__

    def note(self: Database, folder: Path) -> None:
        initialise(self, folder)
        made.append(self)

    monkeypatch.setattr(Database, "__init__", note)
    yield
    for database in made:
        database.close()
