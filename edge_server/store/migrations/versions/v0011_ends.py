"""The report that ended a mission is known, so that a repeated one is answered and not kept."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"


def upgrade() -> None:
    """Which reports ended the missions that are here is not known: one more may be forwarded."""
    record_id = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
    op.add_column("work", sa.Column("end_record", record_id))
    op.add_column("work", sa.Column("end_message_id", sa.String(26)))


def downgrade() -> None:
    """The older version forwards every repetition."""
    op.drop_column("work", "end_message_id")
    op.drop_column("work", "end_record")
