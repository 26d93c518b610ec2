"""Store and forward: every record is kept until the cloud has it, at least once and in order."""
