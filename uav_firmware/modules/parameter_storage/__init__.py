"""Keeps changed parameters over a restart."""
