"""What waits for the edge server, on disk: it survives the broker, and is told by the next one."""
