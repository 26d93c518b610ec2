"""Brings the state folder into order: database, tables, keys."""

import time

from edge_server import key_files
from edge_server.config import Config
from edge_server.store import migrate
from edge_server.store.database import Database
from edge_server.store.engines import open_engine


def prepare(config: Config) -> None:
    """Make what is missing and update what is old; harmless when all is well.

    Raises:
        StoreError: if the database cannot be used.
        OpenSecretError: if others can read a secret that was given to us.
    """
    key_files.check_given(config)
    config.edge_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    migrate.prepare(config.database)
    database = open_database(config)
    try:
        key_files.ensure(database, config.keys_dir, time.time())
    finally:
        database.close()


def open_database(config: Config) -> Database:
    """Open the database of a state folder, outside Flask."""
    return Database(open_engine(config.database))
