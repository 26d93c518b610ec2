"""The edge server over HTTP: work in, reports out, and what waits for it on the disk."""
