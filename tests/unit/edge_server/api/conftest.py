"""HTTP is the same on every database: most of these tests run on SQLite alone.

A module or a test that is about what the database does is marked with `BOTH_ENGINES`.
"""

import pytest


@pytest.fixture
def engine_name(request: pytest.FixtureRequest) -> str:
    """The kind of database: SQLite unless the test says otherwise."""
    return str(getattr(request, "param", "sqlite"))
