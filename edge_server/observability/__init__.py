"""Logs, metrics, and the health of the relay."""
