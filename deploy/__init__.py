"""What the containers need beside the programs: health checks, keys, a flight as a test."""
