"""Secret files, TLS, and redaction of log lines."""
