"""When the cloud rejected a record, which is shown with it."""

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"


def upgrade() -> None:
    """When a record was rejected before is not known."""
    op.add_column("outbox", sa.Column("rejected_at", sa.Float))


def downgrade() -> None:
    """The older version shows no time."""
    op.drop_column("outbox", "rejected_at")
