"""Connections to the database: engines, transactions, locks, errors."""
