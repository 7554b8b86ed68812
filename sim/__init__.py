"""The simulated cell: arm and camera in process, and peers that speak real devices' protocols."""
