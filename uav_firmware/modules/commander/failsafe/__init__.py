"""Which causes are present, and what is done about the worst."""
