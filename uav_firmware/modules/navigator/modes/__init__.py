"""One file per flight mode of the navigator, each with the same four hooks."""
