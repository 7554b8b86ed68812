"""Arms and cameras behind two small protocols, one plain class per device.

Imports no other package of ours.
"""
