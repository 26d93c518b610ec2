"""The log protocol: list, download, stream."""
