"""Store and forward: every record reaches the cloud at least once, in order, or is kept."""
