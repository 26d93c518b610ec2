"""What the program's exit code says."""

OK = 0
FAILED = 1
WRONG_SETUP = 2
