"""Flight modes: what each needs and who leads in it."""
