#!/bin/sh
# mrcal-to-kalibr of mrcal 2.5.2.post1, beside NumPy 2, writes a camchain that is no camchain: numbers
# as np.float64(...), and the distortion coefficients as a list of the letters of such a text.
# mrcal-from-ros of the same version refuses rational_polynomial with 14 coefficients.
# Seen on 2026-11-29 with Python 3.12 and NumPy 2. Needs python3.12 (mrcal has no wheels for 3.11).
set -eu
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT; cd "$work"
for p in python3.12 python3.13 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.1[23]*/bin/python; do
  "$p" -m venv v 2> /dev/null && break
done
v/bin/python -m pip install --quiet --no-deps mrcal==2.5.2.post1 numpy==2.5.5 numpysane==0.45 \
  packaging pyyaml==6.0.4
cat > a.cameramodel <<'MODEL'
{
    'lensmodel':  'LENSMODEL_OPENCV4',
    'intrinsics': [ 1000., 1000., 639.5, 479.5, -0.1, 0.05, 0.001, -0.0005 ],
    'rt_cam_ref': [ 0., 0., 0., 0., 0., 0. ],
    'imagersize': [ 1280, 960 ],
}
MODEL
v/bin/python v/bin/mrcal-to-kalibr a.cameramodel > camchain.yaml
cat camchain.yaml
grep -q 'np.float64(1000.0)' camchain.yaml
grep -q "distortion_coeffs: \['f', 'l', 'o', 'a', 't'" camchain.yaml
cat > ros.yaml <<'ROS'
image_width: 1280
image_height: 960
camera_name: c
camera_matrix: {rows: 3, cols: 3, data: [1000, 0, 639.5, 0, 1000, 479.5, 0, 0, 1]}
distortion_model: rational_polynomial
distortion_coefficients: {rows: 1, cols: 14, data: [-0.1, 0.05, 0.001, 0, 0, 0, 0, 0, 0.001, 0, 0, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [1000, 0, 639.5, 0, 0, 1000, 479.5, 0, 0, 0, 1, 0]}
ROS
if v/bin/python v/bin/mrcal-from-ros ros.yaml > out.txt 2>&1; then echo 'CHANGED: 14 coefficients are read'; exit 1; fi
tail -1 out.txt
grep -q 'Mismatched Nintrinsics. Got 18' out.txt
echo 'as described'
