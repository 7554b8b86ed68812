"""Where a block of corners keeps its quantities while it is projected.

Corners go through in blocks, each quantity in a row of its own: straight loops over rows at a fixed
distance are what LLVM turns into instructions for four or eight corners at once.
"""

from __future__ import annotations

from calib.chain.optics import OPTICS

K = len(OPTICS)

BLOCK = 64
"""Corners that go through together: their rows stay in the fastest cache."""
LANES = 8
"""Corners that an instruction may take at once; blocks are filled up to a multiple of it."""
# rows of a block's `work`: the point in the board's frame, in the camera's, there with the board
# at rest; its depth as the lens sees it, with derivatives by x, y, z, pupil and window; the pixel;
# how late its row is read; the pixel's derivatives by the depth; the distorted point; the ideal
# one (A, B) = (X, Y) G, G's slope by the distance from the axis over that distance, and by depth
PX, PY, PZ, X, Y, Z, RX, RY, RZ, ZS, S0, S1, S2, S3, S4, U, V, LATE, US, VS, XD, YD = (
    BLOCK * k for k in range(22)
)
A, B, G, H, S = (BLOCK * k for k in range(22, 27))
WORK = 27 * BLOCK
# rows of its derivatives `jac`, by the pose and by the optics: of u in the first half, of v in the
# second
ROW = 2 * BLOCK
OPTIC = 6 * ROW
JAC = (6 + K) * ROW
