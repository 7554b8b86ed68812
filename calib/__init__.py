"""Calibration core: the measurement chain, the fits that walk it, and the discovery."""
