#!/bin/sh
# A URDF joint that has no <axis> turns about x: the format's documented default is (1, 0, 0).
# kinpy 0.6.1 turns it about z, without a word. Its forward kinematics of a file that leaves the axis out
# are another arm's. ikpy 4.2.1, yourdfpy 0.0.60, urchin 0.0.30 and pytransform3d 3.17.0 follow the format.
# Seen with Python 3.11: the camera frame below is 34 mm and 1.12 rad away from where the others put it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
# one after the other: their requirements, taken together, keep the resolver busy for long
for package in numpy==2.4.6 scipy==1.17.1 kinpy==0.6.1 ikpy==4.2.1 yourdfpy==0.0.60 urchin==0.0.30 pytransform3d==3.17.0; do
  "$dir/venv/bin/python" -m pip install --quiet --only-binary=:all: "$package"
done
cat > "$dir/arm.urdf" <<'URDF'
<?xml version="1.0"?>
<robot name="bench">
  <link name="base"/><link name="flange"/><link name="camera"/>
  <joint name="j1" type="revolute">
    <parent link="base"/><child link="flange"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <joint name="hand_eye" type="fixed">
    <parent link="flange"/><child link="camera"/>
    <origin xyz="0.01 0.02 0.03" rpy="0.7 -1.2 2.1"/>
  </joint>
</robot>
URDF
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys

import ikpy.chain
import kinpy
import numpy as np
import urchin
import yourdfpy
from pytransform3d.urdf import UrdfTransformManager
from scipy.spatial.transform import Rotation

ANGLE = 0.8
TEXT = open("arm.urdf").read()


def placed(xyz, rotation):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation.as_matrix(), xyz
    return out


def expected(axis):
    return (
        placed((0.1, 0.2, 0.3), Rotation.from_euler("xyz", (0.4, -0.5, 0.6)))
        @ placed((0, 0, 0), Rotation.from_rotvec(ANGLE * np.array(axis)))
        @ placed((0.01, 0.02, 0.03), Rotation.from_euler("xyz", (0.7, -1.2, 2.1)))
    )


def by_pytransform3d():
    manager = UrdfTransformManager()
    manager.load_urdf(TEXT)
    manager.set_joint("j1", ANGLE)
    return manager.get_transform("camera", "base")


def by_yourdfpy():
    urdf = yourdfpy.URDF.load("arm.urdf", load_meshes=False)
    urdf.update_cfg([ANGLE])
    return urdf.get_transform("camera", "base")


def by_urchin():
    found = urchin.URDF.load("arm.urdf").link_fk(cfg={"j1": ANGLE})
    return next(pose for link, pose in found.items() if link.name == "camera")


chain = ikpy.chain.Chain.from_urdf_file("arm.urdf", base_elements=["base"])
poses = {
    "ikpy": chain.forward_kinematics([0, ANGLE, 0]),
    "yourdfpy": by_yourdfpy(),
    "urchin": by_urchin(),
    "pytransform3d": by_pytransform3d(),
    "kinpy": kinpy.build_serial_chain_from_urdf(TEXT, "camera").forward_kinematics([ANGLE]).matrix(),
}
about = {}
for name, pose in poses.items():
    off = {axis: np.abs(pose - expected(v)).max() for axis, v in zip("xyz", np.eye(3))}
    about[name] = min(off, key=off.get)
    print(f"{name:14} turns about {about[name]}; off by {1e3 * np.linalg.norm(pose[:3, 3] - expected((1, 0, 0))[:3, 3]):.1f} mm")
    assert off[about[name]] < 1e-9
sys.exit(about != {"ikpy": "x", "yourdfpy": "x", "urchin": "x", "pytransform3d": "x", "kinpy": "z"})
PY
