"""Frames: dialect, signatures, peers, reception, dispatch, transmission."""
