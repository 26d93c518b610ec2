"""The vehicle and its surroundings as physics: airframe, rotors, wind, Earth, true state."""
