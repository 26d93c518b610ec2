"""Logs, metrics, and whether the relay runs."""
