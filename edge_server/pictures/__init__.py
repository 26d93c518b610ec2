"""Pictures made smaller, by a separate program with bounded memory and time."""
