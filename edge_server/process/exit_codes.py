"""Exit codes of the program."""

OK = 0
FAILED = 1
WRONG_SETUP = 2
INTERRUPTED = 130
"""As shells report a program that SIGINT has ended."""
