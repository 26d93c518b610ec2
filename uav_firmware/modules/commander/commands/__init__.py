"""Decisions on commands."""
