"""Missions that wait for their dispatch."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Every mission that is here already may be flown."""
    column = sa.Column("held", sa.Boolean, nullable=False, server_default=sa.false())
    op.add_column("work", column)


def downgrade() -> None:
    """The older version flies what it finds queued, so what is held goes."""
    op.execute("DELETE FROM work WHERE held")
    op.drop_column("work", "held")
