#!/bin/sh
# harvesters 1.4.3: a GenDC container is handed out as an ordinary 2-D image.
#
# GenTL tells the payload's type (11, GenDC), and harvesters has no class for it: it falls back to
# PayloadImage with one Component2DImage whose width, height and pixel format are those of the
# camera's image, and whose data begin at the container's first byte ("GNDC"). The picture looks
# right and is displaced by the length of the container's descriptor; no error, no warning.
# Expected: an error, or the image part of the container.
#
# Exit status 0 while this is so, 1 when it has changed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet harvesters==1.4.3 genicam==1.6.0 numpy
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version
from pathlib import Path

import genicam
from harvesters.core import Harvester

print(f"harvesters {version('harvesters')}, genicam {version('genicam')} with its producer viky.cti")
producer = str(Path(genicam.__file__).parent / "viky.cti")


def shown(mode):
    harvester = Harvester()
    harvester.add_file(producer)
    harvester.update()
    acquirer = harvester.create({"serial_number": "0"})
    acquirer.remote_device.node_map.GenDCStreamingMode.value = mode
    acquirer.start()
    buffer = acquirer.fetch(timeout=5.0)
    [part] = buffer.payload.components
    told = (type(buffer.payload).__name__, int(buffer.module.payload_type), part.width,
            part.height, part.data_format, part.data[:8].tobytes())
    buffer.queue()
    acquirer.stop()
    acquirer.destroy()
    harvester.reset()
    print(f"GenDCStreamingMode {mode}: {told}")
    return told


plain, container = shown("Off"), shown("On")
same = (plain[0] == container[0] == "PayloadImage" and plain[2:5] == container[2:5]
        and container[1] == 11 and container[5][:4] == b"GNDC")
print("a container is shown as an image" if same else "the behaviour has changed")
sys.exit(not same)
PYTHON
