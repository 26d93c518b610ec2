"""MAVLink 2 signatures: keys, checks, set-up over a link."""
