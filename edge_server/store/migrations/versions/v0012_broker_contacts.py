"""When a broker last made a request about a vehicle, before which its mission is not closed."""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"


def upgrade() -> None:
    """No contact is known; until a broker makes a request, the vehicle's own row decides."""
    op.create_table(
        "broker_contact",
        sa.Column(
            "vehicle_id",
            sa.BigInteger().with_variant(sa.Integer(), "sqlite"),
            primary_key=True,
            autoincrement=False,
        ),
        sa.Column("broker", sa.String(80), nullable=False, index=True),
        sa.Column("at", sa.Float, nullable=False),
    )


def downgrade() -> None:
    """In the older version only the vehicle's own row decides."""
    op.drop_table("broker_contact")
