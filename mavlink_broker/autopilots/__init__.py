"""How families of autopilots differ, as tables. Pure."""
