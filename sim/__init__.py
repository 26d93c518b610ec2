"""The simulated world: JSBSim physics, sensors, mock cloud and launcher."""
