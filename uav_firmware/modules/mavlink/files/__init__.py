"""Files for peers: MAVFTP, the MAVLink file transfer protocol's vehicle end."""
