"""Deterministic simulation testing: the whole system in one process, one thread, from one seed."""
