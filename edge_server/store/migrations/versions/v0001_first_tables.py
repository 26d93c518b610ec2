"""The first tables."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

_ID = sa.BigInteger().with_variant(sa.Integer(), "sqlite")  # SQLite's Integer has 64 bits


def upgrade() -> None:
    """Make every table."""
    _telemetry()
    _outbox()
    _receipts()
    _plans()
    _work()
    op.create_table(
        "access_key",
        sa.Column("prefix", sa.String(8), primary_key=True),
        sa.Column("role", sa.String(10), nullable=False),
        sa.Column("sha256", sa.LargeBinary(32), nullable=False),
        sa.Column("created_at", sa.Float, nullable=False),
        sa.Column("revoked_at", sa.Float),
    )


def downgrade() -> None:
    """Drop every table, those that refer to others first."""
    for table in (
        "command",
        "work",
        "plan",
        "vehicle",
        "outbox",
        "telemetry",
        "tombstone",
        "idempotency",
        "access_key",
    ):
        op.drop_table(table)


def _telemetry() -> None:
    op.create_table(
        "telemetry",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("message_id", sa.String(26), nullable=False, unique=True),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("vehicle_id", sa.Integer, nullable=False),
        sa.Column("payload", sa.Text, nullable=False),
        sa.Column("received_at", sa.Float, nullable=False),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_telemetry_kind_id", "telemetry", ["kind", "id"])


def _outbox() -> None:
    op.create_table(
        "outbox",
        sa.Column("id", _ID, primary_key=True),
        sa.Column(
            "record_id",
            _ID,
            sa.ForeignKey("telemetry.id", ondelete="CASCADE"),
            nullable=False,
            unique=True,
        ),
        sa.Column("vehicle_id", sa.Integer, nullable=False),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("state", sa.String(8), nullable=False, server_default="queued"),
        sa.Column("attempts", sa.Integer, nullable=False, server_default="0"),
        sa.Column("last_error", sa.Text),
        sa.CheckConstraint("state IN ('queued', 'dead')", name="state"),
        sa.CheckConstraint("state <> 'dead' OR last_error IS NOT NULL", name="dead_has_reason"),
        sqlite_autoincrement=True,
    )
    op.create_index(
        "ix_outbox_vehicle_id_kind_state_id", "outbox", ["vehicle_id", "kind", "state", "id"]
    )


def _receipts() -> None:
    op.create_table(
        "tombstone",
        sa.Column("message_id", sa.String(26), primary_key=True),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("vehicle_id", sa.Integer, nullable=False),
        sa.Column("record_id", _ID, nullable=False),
        sa.Column("http_status", sa.Integer, nullable=False),
        sa.Column("attempts", sa.Integer, nullable=False),
        sa.Column("delivered_at", sa.Float, nullable=False),
    )
    op.create_index("ix_tombstone_delivered_at", "tombstone", ["delivered_at"])
    op.create_table(
        "idempotency",
        sa.Column("key", sa.String(64), primary_key=True),
        sa.Column("role", sa.String(10), primary_key=True),
        sa.Column("route", sa.String(20), nullable=False),
        sa.Column("body_sha256", sa.LargeBinary(32), nullable=False),
        sa.Column("object_id", _ID, nullable=False),
        sa.Column("message_id", sa.String(26)),
        sa.Column("created_at", sa.Float, nullable=False),
    )
    op.create_index("ix_idempotency_created_at", "idempotency", ["created_at"])


def _plans() -> None:
    op.create_table(
        "vehicle",
        sa.Column("vehicle_id", _ID, primary_key=True, autoincrement=False),
        sa.Column("state", sa.Text, nullable=False),
        sa.Column("registered_at", sa.Float, nullable=False),
        sa.Column("updated_at", sa.Float, nullable=False),
    )
    op.create_table(
        "plan",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("plan_id", sa.String(26), nullable=False, unique=True),
        sa.Column("body", sa.Text, nullable=False),
        sa.Column("received_at", sa.Float, nullable=False),
        sa.Column("expires_at", sa.Float, nullable=False),
        sa.Column("warnings", sa.Text, nullable=False),
        sqlite_autoincrement=True,
    )


def _work() -> None:
    op.create_table(
        "work",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("vehicle_id", sa.Integer),
        sa.Column("plan", _ID, sa.ForeignKey("plan.id", ondelete="CASCADE")),
        sa.Column("mission_id", sa.Integer),
        sa.Column("sequence_number", sa.Integer, nullable=False),
        sa.Column("body", sa.Text),
        sa.Column("state", sa.String(8), nullable=False),
        sa.Column("status_id", sa.Integer),
        sa.Column("message", sa.Text),
        sa.Column("report", sa.Text),
        sa.Column("created_at", sa.Float, nullable=False),
        sa.Column("expires_at", sa.Float, nullable=False),
        sa.CheckConstraint("kind IN ('mission', 'latest_state_vector')", name="kind"),
        sa.CheckConstraint("state IN ('queued', 'accepted', 'closed')", name="state"),
        sa.CheckConstraint(
            "(state = 'closed') = (status_id >= 3) OR status_id IS NULL", name="terminal"
        ),
        sa.CheckConstraint(
            "kind <> 'mission' OR (plan IS NOT NULL AND mission_id IS NOT NULL "
            "AND vehicle_id IS NOT NULL AND body IS NOT NULL AND status_id BETWEEN 1 AND 5)",
            name="mission_is_whole",
        ),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_work_plan", "work", ["plan"])
    op.create_index("ix_work_state_id", "work", ["state", "id"])
    op.create_index(
        "ix_work_vehicle_id_mission_id_state", "work", ["vehicle_id", "mission_id", "state"]
    )
    op.create_table(
        "command",
        sa.Column("work", _ID, sa.ForeignKey("work.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("command_id", sa.Integer, primary_key=True),
        sa.Column("status_id", sa.Integer, nullable=False),
        sa.Column("message", sa.Text),
        sa.CheckConstraint("status_id BETWEEN 1 AND 5", name="status"),
    )
