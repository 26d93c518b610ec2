"""MAVLink 2 signatures: keys, verification, set-up over a link."""
