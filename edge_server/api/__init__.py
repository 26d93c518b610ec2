"""The HTTP API: authorization, input, errors, documentation; the endpoints are in `routes`."""
