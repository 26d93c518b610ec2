"""Commands on the terminal: keys, audit, dead-letters."""
