"""One vehicle as the broker knows it: family, telemetry, mode, health, who is in command."""
