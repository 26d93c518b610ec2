"""Run by Alembic: migrates the connection that it was given."""

from alembic import context

import edge_server.store.migrations.partial_indexes  # noqa: F401  # they complete the metadata
from edge_server.store.rows.tables import METADATA

connection = context.config.attributes["connection"]
# SQLite cannot alter most of a table in place; batch mode copies it.
context.configure(connection=connection, target_metadata=METADATA, render_as_batch=True)
with context.begin_transaction():
    context.run_migrations()
