"""Which relay sends which stream, where several relays share a database."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Nobody has a stream yet."""
    op.create_table(
        "stream",
        sa.Column("vehicle_id", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("kind", sa.String(20), primary_key=True),
        sa.Column("owner", sa.Integer),
    )


def downgrade() -> None:
    """The older version has one relay."""
    op.drop_table("stream")
