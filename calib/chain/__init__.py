"""The measurement chain: what a corner of the board passes on its way to a pixel."""
