"""Pictures of a vehicle: announcements, downloads, and posts to the edge server."""
