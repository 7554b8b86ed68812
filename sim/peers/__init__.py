"""Peers that speak the devices' own protocols over loopback, backed by the simulated cell."""
