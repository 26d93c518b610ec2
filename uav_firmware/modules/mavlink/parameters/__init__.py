"""The parameter protocol, and parameters as a file."""
