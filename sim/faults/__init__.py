"""What can break on a simulated vehicle: schedules, notations and effects of faults."""
