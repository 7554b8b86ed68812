#!/bin/sh
# Forward kinematics of a logged joint angle that lies beyond the file's <limit>: scikit-robot 0.4.7 and
# pytransform3d 3.17.0 move the joint back to the limit and give that pose (the former prints a line, the latter
# nothing). A recording whose log is right and whose URDF has narrow limits is then answered with poses that the
# arm never took. ikpy 4.2.1, kinpy 0.6.1, yourdfpy 0.0.60 and urchin 0.0.30 take the angle as it is.
# Seen with 3.1 rad asked and a limit of 3.0: 3.0 rad given.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
# one after the other: their requirements, taken together, keep the resolver busy for long
for package in numpy==2.4.6 scipy==1.17.1 kinpy==0.6.1 ikpy==4.2.1 yourdfpy==0.0.60 urchin==0.0.30 pytransform3d==3.17.0 scikit-robot==0.4.7; do
  "$dir/venv/bin/python" -m pip install --quiet --only-binary=:all: "$package"
done
cat > "$dir/arm.urdf" <<'URDF'
<?xml version="1.0"?>
<robot name="bench">
  <link name="base"/><link name="flange"/>
  <joint name="j1" type="revolute">
    <parent link="base"/><child link="flange"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
</robot>
URDF
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import ikpy.chain
import kinpy
import numpy as np
import skrobot
import urchin
import yourdfpy
from pytransform3d.urdf import UrdfTransformManager

ASKED = 3.1  # rad; the file's limit is 3.0
TEXT = open("arm.urdf").read()


def by_pytransform3d():
    manager = UrdfTransformManager()
    manager.load_urdf(TEXT)
    manager.set_joint("j1", ASKED)
    return manager.get_transform("flange", "base")


def by_skrobot():
    robot = skrobot.models.urdf.RobotModelFromURDF(urdf_file="arm.urdf")
    robot.j1.joint_angle(ASKED)
    return robot.flange.worldcoords().T()


def by_yourdfpy():
    urdf = yourdfpy.URDF.load("arm.urdf", load_meshes=False)
    urdf.update_cfg([ASKED])
    return urdf.get_transform("flange", "base")


def by_urchin():
    found = urchin.URDF.load("arm.urdf").link_fk(cfg={"j1": ASKED})
    return next(pose for link, pose in found.items() if link.name == "flange")


chain = ikpy.chain.Chain.from_urdf_file("arm.urdf", base_elements=["base"])
poses = {
    "ikpy": chain.forward_kinematics([0, ASKED]),
    "kinpy": kinpy.build_serial_chain_from_urdf(TEXT, "flange").forward_kinematics([ASKED]).matrix(),
    "yourdfpy": by_yourdfpy(),
    "urchin": by_urchin(),
    "pytransform3d": by_pytransform3d(),
    "scikit-robot": by_skrobot(),
}
given = {name: float(np.arctan2(pose[1, 0], pose[0, 0])) for name, pose in poses.items()}
for name, angle in given.items():
    print(f"{name:14} {angle:.4f} rad of {ASKED} asked")
clips = {name for name, angle in given.items() if abs(angle - 3.0) < 1e-9}
follows = {name for name, angle in given.items() if abs(angle - ASKED) < 1e-9}
assert clips == {"pytransform3d", "scikit-robot"}, clips
assert follows == {"ikpy", "kinpy", "yourdfpy", "urchin"}, follows
PY
