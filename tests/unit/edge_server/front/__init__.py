"""The front: framing, admission, and the loop over real sockets."""
