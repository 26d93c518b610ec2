"""MAVLink's microservices without input or output: (message or tick, now) -> messages to send."""
