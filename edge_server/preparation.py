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
        OpenSecretError: if a secret that was given to us cannot be used, or others can read it.
    """
    key_files.check_given(config)
    _check_signature_key(config)
    config.edge_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    migrate.prepare(config.database)
    database = open_database(config)
    try:
        key_files.ensure(database, config.keys_dir, time.time())
    finally:
        database.close()


def _check_signature_key(config: Config) -> None:
    if config.cloud_jws_key_file is None:
        return
    from edge_server.api import jws  # noqa: PLC0415  # loads what else nobody needs

    try:
        jws.load(config.cloud_jws_key_file, config.edge_id)
    except jws.SignatureKeyError as error:
        raise key_files.OpenSecretError(f"CLOUD_JWS_KEY_FILE: {error}") from None


def open_database(config: Config) -> Database:
    """Open the database of a state folder, outside Flask."""
    return Database(open_engine(config.database))
