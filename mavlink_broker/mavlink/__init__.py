"""MAVLink frames and messages: dialect, framing, codec, signatures, addresses."""
