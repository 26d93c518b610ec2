"""The sources that correct the filter: GNSS, barometer, magnetometer, drag and rest."""
