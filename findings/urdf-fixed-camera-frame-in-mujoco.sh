#!/bin/sh
# A hand-eye calibration handed on as a URDF fixed joint (flange -> camera) is gone once MuJoCo has read the file:
# mujoco 4.0.0 fuses links behind fixed joints into their parent when it reads URDF, and a link without geometry leaves
# no body, no site and no frame behind. No warning is printed; asking for the camera's body is a KeyError.
# With <mujoco><compiler fusestatic="false"/></mujoco> in the URDF the body is there, where the joint says.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/python" -m pip install --quiet --only-binary=:all: mujoco==4.0.0 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" - <<'PY'
import mujoco
import numpy as np

INERTIA = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
URDF = f"""<robot name="bench">%s
  <link name="base">{INERTIA}</link><link name="flange">{INERTIA}</link><link name="camera">{INERTIA}</link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="flange"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="hand_eye" type="fixed"><parent link="flange"/><child link="camera"/>
    <origin xyz="0.01 0.02 0.03" rpy="0 0 0"/></joint>
</robot>"""


def bodies(extra):
    model = mujoco.MjModel.from_xml_string(URDF % extra)
    return model, [model.body(i).name for i in range(model.nbody)], model.nsite


_, plain, sites = bodies("")
model, kept, _ = bodies('<mujoco><compiler fusestatic="false"/></mujoco>')
print("as it is:", plain, "sites:", sites)
print("fusestatic=false:", kept)
data = mujoco.MjData(model)
mujoco.mj_kinematics(model, data)
print("camera at", data.body("camera").xpos)
assert plain == ["world", "flange"] and sites == 0
assert "camera" in kept and np.allclose(data.body("camera").xpos, [0.01, 0.02, 0.33])
PY
