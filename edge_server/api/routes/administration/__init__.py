"""Routes of sessions, accounts, keys, the audit log and the use of the disk."""
