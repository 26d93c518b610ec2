"""Where the vehicle may be: fence, rally points, ways round."""
