#!/bin/sh
# A COLMAP text model whose images.txt and frames.txt give an image different poses: pycolmap 3.13.0 and 4.2.1 take
# that of frames.txt and say nothing of the other. A program of before 3.12 that moves a model by rewriting
# images.txt (a change of world, of scale) leaves the poses unmoved for newer readers wherever a newer writer put
# rigs.txt and frames.txt beside it. Without these two files the pose of images.txt is taken.
# Seen with Python 3.11: the camera stands at x = -1 by frames.txt, at x = -5 by images.txt.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cat > "$dir/read.py" <<'PY'
import pathlib
import sys

import pycolmap

model = pathlib.Path(sys.argv[1])
model.mkdir(exist_ok=True)
(model / "cameras.txt").write_text("1 PINHOLE 640 480 500 500 320 240\n")
(model / "images.txt").write_text("1 1 0 0 0 5 0 0 1 a.png\n320 240 -1\n")
(model / "points3D.txt").write_text("")
newer = {"rigs.txt": "1 1 CAMERA 1\n", "frames.txt": "1 1 1 0 0 0 1 0 0 1 CAMERA 1 1\n"}
seen = []
for files in ({}, newer):
    for name, text in files.items():
        (model / name).write_text(text)
    read = pycolmap.Reconstruction()
    read.read_text(str(model))
    (image,) = read.images.values()
    seen.append(round(float(image.projection_center()[0]), 9))
print(f"pycolmap {pycolmap.__version__}: x of the camera by images.txt {seen[0]}, with frames.txt {seen[1]}")
sys.exit(seen != [-5.0, -1.0])
PY
for version in 3.13.0 4.2.1; do
  python3 -m venv "$dir/$version"
  "$dir/$version/bin/python" -m pip install --quiet --only-binary=:all: numpy "pycolmap==$version"
  "$dir/$version/bin/python" "$dir/read.py" "$dir/model-$version"
done
