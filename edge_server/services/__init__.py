"""What the edge server does: one transaction per request, no HTTP in here."""
