"""Missions that were cancelled or replaced are remembered."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"


def upgrade() -> None:
    """Which ones there were before is not known."""
    op.create_table(
        "withdrawn",
        sa.Column(
            "work_id",
            sa.BigInteger().with_variant(sa.Integer(), "sqlite"),
            primary_key=True,
            autoincrement=False,
        ),
        sa.Column("plan_id", sa.String(26), nullable=False),
        sa.Column("vehicle_id", sa.Integer, nullable=False),
        sa.Column("mission_id", sa.Integer, nullable=False),
        sa.Column("withdrawn_at", sa.Float, nullable=False),
    )
    op.create_index("ix_withdrawn_plan_id", "withdrawn", ["plan_id"])
    op.create_index("ix_withdrawn_withdrawn_at", "withdrawn", ["withdrawn_at"])
    op.create_index("ix_withdrawn_vehicle_id_mission_id", "withdrawn", ["vehicle_id", "mission_id"])


def downgrade() -> None:
    """The older version forwards reports on work that it has forgotten."""
    op.drop_table("withdrawn")
