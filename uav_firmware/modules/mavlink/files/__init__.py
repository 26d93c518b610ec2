"""Server of MAVFTP, the MAVLink file transfer protocol."""
