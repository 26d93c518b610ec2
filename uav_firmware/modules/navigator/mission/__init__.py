"""Missions: feasibility, items, route, progress."""
