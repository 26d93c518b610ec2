"""Every table, its keys and what each column means. Times are epoch seconds.

Partial indexes are in `store/migrations/partial_indexes.py`.
"""

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    false,
)

METADATA = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)

_ID = BigInteger().with_variant(Integer(), "sqlite")
"""An increasing id, or a number from a request; SQLite's Integer has 64 bits anyway."""

telemetry = Table(
    "telemetry",
    METADATA,
    Column("id", _ID, primary_key=True),  # Never reused, even after the row is deleted
    Column("message_id", String(26), nullable=False, unique=True),  # ULID, the key for the cloud
    Column("kind", String(20), nullable=False),
    Column("vehicle_id", Integer, nullable=False),
    Column("payload", Text, nullable=False),  # The JSON that the cloud gets, message_id included
    Column("received_at", Float, nullable=False),
    Column("size_bytes", Integer, nullable=False, server_default="0"),  # Of the payload, about
    Index(None, "kind", "id"),
    sqlite_autoincrement=True,
)
"""Reports of vehicles and gaps, until the cloud has confirmed them."""

outbox = Table(
    "outbox",
    METADATA,
    Column("id", _ID, primary_key=True),  # The order of sending, within a stream
    Column(
        "record_id",
        ForeignKey("telemetry.id", ondelete="CASCADE"),
        nullable=False,
        unique=True,
    ),
    Column("vehicle_id", Integer, nullable=False),  # With kind: the stream
    Column("kind", String(20), nullable=False),
    Column("state", String(8), nullable=False, server_default="queued"),
    Column("attempts", Integer, nullable=False, server_default="0"),
    Column("last_error", Text),
    Column("sent", Boolean, nullable=False, server_default=false()),  # Of mission reports
    Column("rejected_at", Float),  # Of a dead letter; none before this column
    CheckConstraint("state IN ('queued', 'dead')", name="state"),
    CheckConstraint("state <> 'dead' OR last_error IS NOT NULL", name="dead_has_reason"),
    Index(None, "vehicle_id", "kind", "state", "id"),
    sqlite_autoincrement=True,
)
"""Records that the relay still has to send, and dead letters."""

stream = Table(
    "stream",
    METADATA,
    Column("vehicle_id", Integer, primary_key=True, autoincrement=False),
    Column("kind", String(20), primary_key=True),
    Column("owner", Integer),  # Number of the relay that sends it
)
"""Which relay sends which stream if several relays share a database."""

tombstone = Table(
    "tombstone",
    METADATA,
    Column("message_id", String(26), primary_key=True),
    Column("kind", String(20), nullable=False),
    Column("vehicle_id", Integer, nullable=False),
    Column("record_id", _ID, nullable=False),
    Column("http_status", Integer, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("delivered_at", Float, nullable=False, index=True),
)
"""Records that the cloud has confirmed, without payload."""

idempotency = Table(
    "idempotency",
    METADATA,
    Column("key", String(64), primary_key=True),
    Column("owner", String(80), primary_key=True),  # Role and name of the access key
    Column("route", String(20), nullable=False),
    Column("body_sha256", LargeBinary(32), nullable=False),
    Column("object_id", _ID, nullable=False),
    Column("message_id", String(26)),
    Column("created_at", Float, nullable=False, index=True),
    Column("answer", Text),  # JSON of the object as it was made
)
"""POSTs that were answered with 201, so that a repeated one gets the same answer."""

vehicle = Table(
    "vehicle",
    METADATA,
    Column("vehicle_id", _ID, primary_key=True, autoincrement=False),
    Column("state", Text, nullable=False),  # JSON: its last reported state
    Column("registered_at", Float, nullable=False),
    Column("updated_at", Float, nullable=False),
)

broker_contact = Table(
    "broker_contact",
    METADATA,
    Column("vehicle_id", _ID, primary_key=True, autoincrement=False),
    Column("broker", String(120), nullable=False, index=True),
    Column("at", Float, nullable=False),
    Column("other", String(120)),
    Column("other_at", Float),
)
"""Which broker serves a vehicle and when it last made a request, and the last other one."""

plan = Table(
    "plan",
    METADATA,
    Column("id", _ID, primary_key=True),
    Column("plan_id", String(26), nullable=False, unique=True),
    Column("body", Text, nullable=False),  # JSON of the plan without its missions
    Column("received_at", Float, nullable=False),
    Column("expires_at", Float, nullable=False),
    Column("warnings", Text, nullable=False),  # JSON: path and message each
    sqlite_autoincrement=True,
)

work = Table(
    "work",
    METADATA,
    Column("id", _ID, primary_key=True),  # The broker's cursor counts these
    Column("kind", String(20), nullable=False),
    Column("vehicle_id", Integer),
    Column("plan", ForeignKey("plan.id", ondelete="CASCADE"), index=True),
    Column("mission_id", Integer),
    Column("sequence_number", Integer, nullable=False),
    Column("body", Text),  # JSON of the mission or event as it was posted
    Column("state", String(8), nullable=False),
    Column("status_id", Integer),
    Column("message", Text),
    Column("report", Text),  # JSON of the newest mission report
    Column("created_at", Float, nullable=False),
    Column("expires_at", Float, nullable=False),
    Column("held", Boolean, nullable=False, server_default=false()),  # Waits for dispatch
    Column("place", Integer, nullable=False, server_default="0"),  # Of a mission in its plan
    Column(
        "flown", Boolean, nullable=False, server_default=false()
    ),  # A record has shown it in flight
    Column("fault", Text),  # The fault that ended the mission, or will end it
    Column("accepted_at", Float),
    Column("ended_at", Float),
    Column("end_record", _ID),  # The report that ended a mission, as the cloud gets it
    Column("end_message_id", String(26)),
    CheckConstraint("kind IN ('mission', 'latest_state_vector', 'event')", name="kind"),
    CheckConstraint("state IN ('queued', 'accepted', 'closed')", name="state"),
    CheckConstraint("(state = 'closed') = (status_id >= 3) OR status_id IS NULL", name="terminal"),
    CheckConstraint(
        "kind <> 'mission' OR (plan IS NOT NULL AND mission_id IS NOT NULL "
        "AND vehicle_id IS NOT NULL AND body IS NOT NULL AND status_id BETWEEN 1 AND 5)",
        name="mission_is_whole",
    ),
    Index(None, "state", "id"),
    Index(None, "vehicle_id", "mission_id", "state"),
    sqlite_autoincrement=True,
)
"""The broker's work: missions of plans, events, and requests for a state vector."""

withdrawn = Table(
    "withdrawn",
    METADATA,
    Column("work_id", _ID, primary_key=True, autoincrement=False),
    Column("plan_id", String(26), nullable=False, index=True),
    Column("vehicle_id", Integer, nullable=False),
    Column("mission_id", Integer, nullable=False),
    Column("withdrawn_at", Float, nullable=False, index=True),
    Index(None, "vehicle_id", "mission_id"),
)
"""Missions that were cancelled or replaced: reports on them are refused."""

vehicle_hold = Table(
    "vehicle_hold",
    METADATA,
    Column("vehicle_id", _ID, primary_key=True, autoincrement=False),
    Column("reason", Text, nullable=False),
    Column("mission_id", Integer),  # The mission that a fault has ended
    Column("plan_id", String(26)),
    Column("since", Float, nullable=False),
)
"""Vehicles whose missions wait until an operator releases them."""

command = Table(
    "command",
    METADATA,
    Column("work", ForeignKey("work.id", ondelete="CASCADE"), primary_key=True),
    Column("command_id", Integer, primary_key=True),
    Column("status_id", Integer, nullable=False),
    Column("message", Text),
    CheckConstraint("status_id BETWEEN 1 AND 5", name="status"),
)
"""Status of each command of a mission."""

event = Table(
    "event",
    METADATA,
    Column("id", _ID, primary_key=True),  # Stays when a PUT replaces its work
    Column("work", ForeignKey("work.id", ondelete="CASCADE"), nullable=False, unique=True),
    Column("received_at", Float, nullable=False),
    sqlite_autoincrement=True,
)
"""Events; the state of each is in its work."""

field = Table(
    "field",
    METADATA,
    Column("id", _ID, primary_key=True),
    Column("body", Text, nullable=False),  # JSON: name, boundary, holes, exclusions
    Column("received_at", Float, nullable=False),
    Column("updated_at", Float, nullable=False),
    sqlite_autoincrement=True,
)
"""Boundaries of fields."""

access_key = Table(
    "access_key",
    METADATA,
    Column("prefix", String(8), primary_key=True),
    Column("role", String(10), nullable=False),
    Column("sha256", LargeBinary(32), nullable=False),
    Column("created_at", Float, nullable=False),
    Column("revoked_at", Float),
    Column("name", String(64), nullable=False, server_default=""),
    Column("in_file", Boolean, nullable=False, server_default=false()),  # STATE_DIR/keys/<role>.key
    Column(
        "scopes", String(100), nullable=False, server_default=""
    ),  # Separated by spaces; empty: all rights of the role
    Column("vehicle_ids", Text),  # JSON array; null: every vehicle
    Column("expires_at", Float),
)
"""Access keys, without their secrets."""

account = Table(
    "account",
    METADATA,
    Column("name", String(64), primary_key=True),
    Column("role", String(10), nullable=False),
    Column("password", String(200)),  # Argon2 in its encoded form; null: by link only
    Column("created_at", Float, nullable=False),
    Column("signed_in_at", Float),
    Column("is_disabled", Boolean, nullable=False, server_default=false()),
)
"""People who sign in at the console."""

session = Table(
    "session",
    METADATA,
    Column("prefix", String(8), primary_key=True),
    Column("sha256", LargeBinary(32), nullable=False),
    Column("account", String(64), ForeignKey("account.name", ondelete="CASCADE"), nullable=False),
    Column("created_at", Float, nullable=False),
    Column("expires_at", Float, nullable=False, index=True),
    Column("address", String(64), nullable=False),
    Index(None, "account"),
)
"""Browsers that are signed in, without their secrets; a session that has ended has no row."""

sign_in_link = Table(
    "sign_in_link",
    METADATA,
    Column("sha256", LargeBinary(32), primary_key=True),
    Column("account", String(64), ForeignKey("account.name", ondelete="CASCADE"), nullable=False),
    Column("expires_at", Float, nullable=False, index=True),
)
"""Links that sign a person in once, until they are used or expire."""

audit = Table(
    "audit",
    METADATA,
    Column("id", _ID, primary_key=True, autoincrement=False),  # Without gaps
    Column("at", Float, nullable=False),
    Column("who", String(80), nullable=False),  # Name of the key, or of the user at the shell
    Column("role", String(10), nullable=False),
    Column("key_prefix", String(8), nullable=False),
    Column("address", String(64), nullable=False),
    Column("request_id", String(64), nullable=False),
    Column("action", String(80), nullable=False),
    Column("object", String(400), nullable=False),
    Column("result", String(40), nullable=False),
    Column("prev_hash", LargeBinary(32), nullable=False),
    Column("hash", LargeBinary(32), nullable=False),
    Index(None, "at"),
)
"""Writes by people and the cloud; triggers refuse changes and the removal of recent rows."""

audit_chain = Table(
    "audit_chain",
    METADATA,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("first_id", _ID, nullable=False),  # The newest row that retention has removed
    Column("first_hash", LargeBinary(32), nullable=False),
    Column("last_id", _ID, nullable=False),  # The newest row
    Column("last_hash", LargeBinary(32), nullable=False),
    CheckConstraint("id = 1", name="one_row"),
    CheckConstraint("first_id <= last_id", name="order"),
)
"""Both ends of the audit log, so that cutting it is noticed; a writer locks this row."""

spent_token = Table(
    "spent_token",
    METADATA,
    Column("jti", String(128), primary_key=True),
    Column("expires_at", Float, nullable=False, index=True),
)
"""Signatures of the cloud that have been used, until they expire."""
