"""Connections of clients: framing, limits and the loop that dispatches complete requests."""
