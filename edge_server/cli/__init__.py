"""The commands of the program at a terminal: keys, audit, dead-letters."""
