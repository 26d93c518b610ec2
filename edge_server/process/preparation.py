"""Prepares the state folder: database, tables, keys."""

import logging
import sqlite3
import time

from sqlalchemy.exc import DBAPIError

from edge_server.config import Config, make_state_folder
from edge_server.process import key_files
from edge_server.store import migrate
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine
from edge_server.store.connection.failures import is_full_disk
from edge_server.store.files import ballast

LOG = logging.getLogger(__name__)


def prepare(config: Config) -> None:
    """Create what is missing and migrate what is old; no effect on a prepared folder.

    On a full disk the ballast is released for it, then the reserve for a start.

    Raises:
        ConfigError: if the folder cannot be created.
        StoreError: if the database cannot be used.
        SecretFileError: if a configured secret cannot be used, or others can read it.
        NoSpaceError: if the disk is full and all reserves are released.
    """
    key_files.check_given(config)
    _check_signature_key(config)
    make_state_folder(config)
    reserves = iter((config.ballast_path, config.start_reserve_path))
    while True:
        try:
            _prepare_database(config)
        except (DBAPIError, sqlite3.OperationalError, OSError) as error:
            if not is_full_disk(error):
                raise
            released = next((path for path in reserves if ballast.release(path)), None)
            if released is None:
                raise migrate.NoSpaceError(
                    f"the disk of {config.state_dir} is full; free some space there"
                ) from error
            LOG.warning("the disk is full; the reserve %s is released", released)
        else:
            return


def _prepare_database(config: Config) -> None:
    migrate.prepare(config.database)
    database = open_database(config)
    try:
        key_files.ensure(database, config.keys_dir, time.time())
    finally:
        database.close()


def _check_signature_key(config: Config) -> None:
    if config.cloud_jws_key_file is None:
        return
    from edge_server.api.access import jws  # noqa: PLC0415  # loaded only where it is needed

    try:
        jws.load(config.cloud_jws_key_file, config.edge_id)
    except jws.SignatureKeyError as error:
        raise key_files.SecretFileError(f"CLOUD_JWS_KEY_FILE: {error}") from None


def open_database(config: Config) -> Database:
    """Open the database of a state folder, without Flask."""
    return Database(open_engine(config.database))
