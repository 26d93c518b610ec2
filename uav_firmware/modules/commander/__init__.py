"""Commander: arming, modes, commands and failsafes."""
