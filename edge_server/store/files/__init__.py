"""Files of the state folder: a SQLite file's health and recovery, backup, ballast, counters."""
