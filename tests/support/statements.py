"""SQL statements that are compiled once per process instead of once per engine.

SQLAlchemy compiles each statement to text once per engine; most tests of the edge server make an
application, and with it an engine, of their own. What is compiled depends on the kind of database
and its version alone, and all engines of SQLite are of one library.
"""

from typing import Any, Final

from sqlalchemy import Engine
from sqlalchemy.dialects.sqlite.pysqlite import SQLiteDialect_pysqlite
from sqlalchemy.util import LRUCache

_STATEMENTS: Final = 2000
_COMPILED: Final[LRUCache[Any, Any]] = LRUCache(_STATEMENTS)
_initialize: Final = Engine.__init__


def compile_once() -> None:
    """Have every later engine of SQLite share what was compiled for another one."""

    def initialize(engine: Engine, *arguments: Any, **options: Any) -> None:
        _initialize(engine, *arguments, **options)
        if isinstance(engine.dialect, SQLiteDialect_pysqlite):
            engine._compiled_cache = _COMPILED

    def equals(one: object, other: object) -> bool:
        return type(one) is type(other)

    def hashed(dialect: object) -> int:
        return hash(type(dialect))

    # Part of a statement's key: by itself each engine has one that is equal to no other
    SQLiteDialect_pysqlite.__eq__ = equals  # type: ignore[method-assign]
    SQLiteDialect_pysqlite.__hash__ = hashed  # type: ignore[assignment, method-assign]
    Engine.__init__ = initialize  # type: ignore[assignment, method-assign]
