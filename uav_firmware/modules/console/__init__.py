"""Log lines about state changes, for the terminal of the process."""
