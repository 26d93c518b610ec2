"""Flies on three rotors, spinning."""
