"""Where the vehicle may be: fence, rally points, detours."""
