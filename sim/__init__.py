"""The simulated cell: an arm and a camera in process, and peers that speak the protocols of real devices."""
