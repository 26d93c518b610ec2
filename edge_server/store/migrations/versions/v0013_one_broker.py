"""A vehicle has one broker; another one that makes a request about it is known too."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"


def upgrade() -> None:
    """No contact is known until a broker makes a request, as after `v0012_broker_contacts`."""
    op.drop_table("broker_contact")
    op.create_table(
        "broker_contact",
        _vehicle_id(),
        sa.Column("broker", sa.String(120), nullable=False, index=True),
        sa.Column("at", sa.Float, nullable=False),
        sa.Column("other", sa.String(120)),
        sa.Column("other_at", sa.Float),
    )


def downgrade() -> None:
    """In the older version several brokers may fly one vehicle."""
    op.drop_table("broker_contact")
    op.create_table(
        "broker_contact",
        _vehicle_id(),
        sa.Column("broker", sa.String(80), nullable=False, index=True),
        sa.Column("at", sa.Float, nullable=False),
    )


def _vehicle_id() -> sa.Column[int]:
    record_id = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
    return sa.Column("vehicle_id", record_id, primary_key=True, autoincrement=False)
