"""MAVFTP, the client's side: one file of a vehicle, whole, over a link that loses."""
