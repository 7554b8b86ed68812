"""The simulated cell: arm and camera in process, and peers that speak real devices' protocols.

Imports the protocols in `drivers` and the physics in `calib.chain`.
"""
