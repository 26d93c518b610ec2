"""Processes of the edge server: web server, relay and supervisor; periodic tasks."""
