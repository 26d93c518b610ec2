"""Frames: dialect, peers, reception, dispatch, transmission."""
