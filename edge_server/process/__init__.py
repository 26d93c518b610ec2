"""The processes of the edge server: web server, relay, their supervisor, housekeeping."""
