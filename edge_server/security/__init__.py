"""Files with secrets, TLS, and what must not be in a log."""
