"""Routes of plans, files, fields, surveys and maps."""
