"""MAVFTP client: downloads one file of a vehicle over a lossy link."""
