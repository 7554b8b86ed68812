#!/bin/sh
# librealsense's projection and deprojection are no pair for every distortion model. pyrealsense2 2.59.1.11053:
# - modified_brown_conrady: rs2_project_point_to_pixel applies the coefficients, rs2_deproject_pixel_to_point leaves
#   them out without an error: a point at 1 m comes back 5.7 mm aside in the case below;
# - brown_conrady and inverse_brown_conrady come back to 1e-6.
# - inverse_brown_conrady projects to the same pixel as modified_brown_conrady: two names, one forward formula.
# Intrinsics are plain numbers there, so no camera is needed.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/python" -m pip install --quiet --only-binary=:all: pyrealsense2==2.59.1.11053 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import numpy as np
import pyrealsense2 as rs

POINT = [0.3, 0.2, 1.0]


def there_and_back(model):
    camera = rs.intrinsics()
    camera.width, camera.height = 1280, 720
    camera.ppx, camera.ppy, camera.fx, camera.fy = 640.0, 360.0, 900.0, 900.0
    camera.model, camera.coeffs = getattr(rs.distortion, model), [0.15, -0.4, 0.001, 0.002, 0.3]
    pixel = rs.rs2_project_point_to_pixel(camera, POINT)
    return np.array(pixel), np.array(rs.rs2_deproject_pixel_to_point(camera, pixel, 1.0))


off_mm, pixels = {}, {}
for model in ("none", "brown_conrady", "inverse_brown_conrady", "modified_brown_conrady"):
    pixels[model], back = there_and_back(model)
    off_mm[model] = 1e3 * float(np.linalg.norm(back - POINT))
    print(f"{model:24} {pixels[model].round(3)} comes back {off_mm[model]:.4f} mm off")
assert max(off_mm[m] for m in ("none", "brown_conrady", "inverse_brown_conrady")) < 1e-2
assert 5 < off_mm["modified_brown_conrady"] < 6.5
assert np.allclose(pixels["inverse_brown_conrady"], pixels["modified_brown_conrady"])
assert np.abs(pixels["modified_brown_conrady"] - pixels["none"]).max() > 4
PY
