"""Frames in and out: dialect, peers, reception, transmission."""
