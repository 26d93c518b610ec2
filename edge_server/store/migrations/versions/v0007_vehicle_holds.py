"""Vehicles whose queue waits for an operator; the place of a mission in its plan."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    """No vehicle is held; the missions of a plan are in the order of their ids so far."""
    op.create_table(
        "vehicle_hold",
        sa.Column(
            "vehicle_id",
            sa.BigInteger().with_variant(sa.Integer(), "sqlite"),
            primary_key=True,
            autoincrement=False,
        ),
        sa.Column("reason", sa.Text, nullable=False),
        sa.Column("mission_id", sa.Integer),
        sa.Column("plan_id", sa.String(26)),
        sa.Column("since", sa.Float, nullable=False),
    )
    op.add_column("work", sa.Column("place", sa.Integer, nullable=False, server_default="0"))


def downgrade() -> None:
    """The older version holds no vehicle."""
    op.drop_column("work", "place")
    op.drop_table("vehicle_hold")
