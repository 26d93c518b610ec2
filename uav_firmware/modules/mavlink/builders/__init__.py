"""Messages built from topics: pure functions, one file per family."""
