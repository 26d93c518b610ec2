"""Commands on the terminal: keys, audit, users, dead-letters, backup, restore."""
