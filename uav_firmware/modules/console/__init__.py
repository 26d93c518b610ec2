"""Plain log lines for whoever watches the process."""
