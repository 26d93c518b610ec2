"""Stores changed parameters across restarts."""
