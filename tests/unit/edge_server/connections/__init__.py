"""Connection handling: framing, admission, and the loop over real sockets."""
