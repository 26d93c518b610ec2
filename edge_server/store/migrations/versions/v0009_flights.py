"""What is known of the flight of a mission: its times, that it flew, the fault that ended it."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"

_INDEX = "ix_work_not_flown"
_NOT_FLOWN = sa.text("accepted_at IS NOT NULL AND NOT flown")


def upgrade() -> None:
    """A mission that is under way has flown if a command of it has begun."""
    flown = sa.Column("flown", sa.Boolean, nullable=False, server_default=sa.false())
    op.add_column("work", flown)
    op.add_column("work", sa.Column("fault", sa.Text))
    op.add_column("work", sa.Column("accepted_at", sa.Float))
    op.add_column("work", sa.Column("ended_at", sa.Float))
    op.execute(
        "UPDATE work SET accepted_at = created_at, flown = EXISTS (SELECT 1 FROM command "
        "WHERE command.work = work.id AND command.status_id IN (2, 3)) "
        "WHERE kind = 'mission' AND state = 'accepted'"
    )
    op.create_index(
        _INDEX, "work", ["vehicle_id"], sqlite_where=_NOT_FLOWN, postgresql_where=_NOT_FLOWN
    )


def downgrade() -> None:
    """The older version judges by the statuses of the commands alone."""
    op.drop_index(_INDEX, "work")
    for name in ("ended_at", "accepted_at", "fault", "flown"):
        op.drop_column("work", name)
