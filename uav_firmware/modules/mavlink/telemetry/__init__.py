"""What the vehicle sends by itself: messages, rates, schedules."""
