"""The processes of the edge server: web server, relay, their supervisor, and tasks beside them."""
