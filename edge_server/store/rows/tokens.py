"""Which signatures of the cloud have been used; each authorizes one effect."""

from sqlalchemy import Connection, delete, insert, select
from sqlalchemy.exc import IntegrityError

from edge_server.store.rows.tables import spent_token


def spend(connection: Connection, jti: str, expires_at: float) -> bool:
    """Mark a signature as used; returns False if it was, and then the transaction must fail."""
    used = select(spent_token.c.jti).where(spent_token.c.jti == jti)
    if connection.execute(used).first() is not None:
        return False
    try:
        connection.execute(insert(spent_token), {"jti": jti, "expires_at": expires_at})
    except IntegrityError:  # Another server was faster
        return False
    return True


def delete_before(connection: Connection, moment: float) -> None:
    """Delete signatures that have expired."""
    connection.execute(delete(spent_token).where(spent_token.c.expires_at < moment))
