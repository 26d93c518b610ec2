"""Keys with names and scopes, the audit log and its chain, spent signatures of the cloud."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"

_NOTHING = b"\0" * 32
_ID = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    """A key that is here already is the one of its role's file, and opens what it opened."""
    for column in _key_columns():
        op.add_column("access_key", column)
    op.execute(sa.text("UPDATE access_key SET name = role, in_file = true"))
    _audit()
    _guard()
    spent = sa.Column("jti", sa.String(128), primary_key=True)
    op.create_table("spent_token", spent, sa.Column("expires_at", sa.Float, nullable=False))
    op.create_index("ix_spent_token_expires_at", "spent_token", ["expires_at"])


def downgrade() -> None:
    """What the older version would let in without limits is revoked."""
    narrow = "scopes <> '' OR vehicle_ids IS NOT NULL OR expires_at IS NOT NULL"
    op.execute(sa.text(f"DELETE FROM access_key WHERE {narrow}"))  # noqa: S608  # our own words
    for column in _key_columns():
        op.drop_column("access_key", column.name)
    for table in ("audit", "audit_chain", "spent_token"):
        op.drop_table(table)
    if op.get_bind().dialect.name == "postgresql":
        op.execute(sa.text("DROP FUNCTION audit_is_append_only()"))


def _key_columns() -> tuple[sa.Column[object], ...]:
    return (
        sa.Column("name", sa.String(64), nullable=False, server_default=""),
        sa.Column("in_file", sa.Boolean, nullable=False, server_default=sa.false()),
        sa.Column("scopes", sa.String(100), nullable=False, server_default=""),
        sa.Column("vehicle_ids", sa.Text),
        sa.Column("expires_at", sa.Float),
    )


def _audit() -> None:
    texts = {"who": 80, "role": 10, "key_prefix": 8, "address": 64, "request_id": 64}
    texts |= {"action": 80, "object": 400, "result": 40}
    op.create_table(
        "audit",
        sa.Column("id", _ID, primary_key=True, autoincrement=False),
        sa.Column("at", sa.Float, nullable=False),
        *(sa.Column(name, sa.String(length), nullable=False) for name, length in texts.items()),
        sa.Column("prev_hash", sa.LargeBinary(32), nullable=False),
        sa.Column("hash", sa.LargeBinary(32), nullable=False),
    )
    op.create_index("ix_audit_at", "audit", ["at"])
    chain = op.create_table(
        "audit_chain",
        sa.Column("id", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("first_id", _ID, nullable=False),
        sa.Column("first_hash", sa.LargeBinary(32), nullable=False),
        sa.Column("last_id", _ID, nullable=False),
        sa.Column("last_hash", sa.LargeBinary(32), nullable=False),
        sa.CheckConstraint("id = 1", name="one_row"),
        sa.CheckConstraint("first_id <= last_id", name="order"),
    )
    empty = {"first_id": 0, "first_hash": _NOTHING, "last_id": 0, "last_hash": _NOTHING}
    op.bulk_insert(chain, [{"id": 1, **empty}])


def _guard() -> None:
    """Let the database itself refuse what would falsify the log."""
    if op.get_bind().dialect.name == "postgresql":
        for statement in _POSTGRESQL:
            op.execute(sa.text(statement))
        return
    for statement in _SQLITE:
        op.execute(sa.text(statement))


_SQLITE = (
    """CREATE TRIGGER audit_never_changes BEFORE UPDATE ON audit
       BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END""",
    """CREATE TRIGGER audit_stays BEFORE DELETE ON audit
       WHEN OLD.id > (SELECT first_id FROM audit_chain)
       BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END""",
)
_POSTGRESQL = (
    """CREATE FUNCTION audit_is_append_only() RETURNS trigger LANGUAGE plpgsql AS $$
       BEGIN
         IF TG_OP = 'DELETE' THEN
           IF OLD.id <= (SELECT first_id FROM audit_chain) THEN RETURN OLD; END IF;
         END IF;
         RAISE EXCEPTION 'the audit log is append-only';
       END $$""",
    """CREATE TRIGGER audit_is_append_only BEFORE UPDATE OR DELETE ON audit
       FOR EACH ROW EXECUTE FUNCTION audit_is_append_only()""",
)
