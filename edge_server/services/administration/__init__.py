"""Accounts, access keys and passwords, backups, and the use of the disk."""
