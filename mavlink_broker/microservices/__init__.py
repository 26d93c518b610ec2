"""MAVLink's services without input or output: (message or tick, now) -> messages to send.

Command protocol: `command`. Mission protocol (mission, geofence, rally points): `mission_protocol`,
`mission_upload`, `mission_download`, `mission_verify`, `mission_clear`, `mission_set_current`.
Parameter protocol: `parameter`; `config_overrides` restores what a mission changes. Heartbeats and
streams: `heartbeat`, `message_rates`, `status_text`. Link estimates: `round_trip`,
`message_timeout`, `reboot`.
"""
