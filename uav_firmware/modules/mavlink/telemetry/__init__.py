"""Telemetry: streamed messages, their rates and schedules."""
