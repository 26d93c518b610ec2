"""How large each record is, so that budgets can be kept without reading what they bound."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Measure what is there, once; index pictures by size and find dead letters at once."""
    column = sa.Column("size_bytes", sa.Integer, nullable=False, server_default="0")
    op.add_column("telemetry", column)
    op.execute("UPDATE telemetry SET size_bytes = length(payload)")
    images = sa.text("kind = 'image'")
    op.create_index(
        "ix_telemetry_kind_size_bytes",
        "telemetry",
        ["kind", "size_bytes"],
        sqlite_where=images,
        postgresql_where=images,
    )
    dead = sa.text("state = 'dead'")
    op.create_index("ix_outbox_dead", "outbox", ["id"], sqlite_where=dead, postgresql_where=dead)


def downgrade() -> None:
    """Forget the sizes."""
    op.drop_index("ix_outbox_dead", "outbox")
    op.drop_index("ix_telemetry_kind_size_bytes", "telemetry")
    op.drop_column("telemetry", "size_bytes")
