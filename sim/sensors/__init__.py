"""Instruments: each turns the truth into what a real one of its kind would read."""
