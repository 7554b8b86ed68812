"""`cell verify`: an old calibration checked against the camera as it is now."""
