"""MAVFTP, parameter files, and flight logs as list, download and stream."""
