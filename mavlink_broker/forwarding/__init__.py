"""A ground station beside the broker: what it sees, what it may say, what is answered instead.

Nothing here knows a clock, a socket or a session: frames and messages in, frames out.
"""
