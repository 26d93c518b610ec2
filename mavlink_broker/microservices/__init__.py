"""MAVLink's services without input or output: (message or tick, now) -> messages to send.

Command protocol: `command`. Mission protocol (mission, geofence, rally points): `mission_protocol`,
`mission_upload`, `mission_download`. Parameter protocol: `parameter`; `config_overrides` restores
what a mission changes. Heartbeats, reboots, and whether a vehicle receives: `link_state`; streams:
`message_rates`. Files: `ftp_download`, `ftp_requests`; logs: `log_download`. Keys of signed links:
`signing_setup`.
"""
