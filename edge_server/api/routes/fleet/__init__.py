"""Routes of vehicles, their events and live pictures, and the work for brokers."""
