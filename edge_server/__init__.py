"""The farm's edge server: plans in by REST, telemetry kept until the cloud has it."""
