"""Bodies of arms and of what stands around them, and how near they come to each other.

`arm_bodies` knows the arms known by name; a `Scene` answers "how near, where, between what" for a
pose or along a joint move. Nobody else knows how distances are worked out.
"""

from calib.bodies.arms import arm_bodies
from calib.bodies.scene import FIXED, Body, Nearest, Scene
from calib.bodies.shape import Shape, behind, box, capsule

__all__ = ["FIXED", "Body", "Nearest", "Scene", "Shape", "arm_bodies", "behind", "box", "capsule"]
