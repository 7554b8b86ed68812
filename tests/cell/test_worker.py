from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import sys, time
import cv2, numpy as np
from cell.sequencer.worker import Worker

def job():
    began_s = time.monotonic()
    while time.monotonic() - began_s < 1.0:
        cv2.GaussianBlur(image, (31, 31), 5)

image = np.zeros((3000, 4000), np.uint8)
Worker().do(job)
time.sleep(0.3)
sys.exit(4)
"""


def test_a_program_that_ends_while_opencv_works_keeps_its_exit_status() -> None:
    """Without waiting for the job: `terminate called without an active exception`, status 134."""
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (4, "")
