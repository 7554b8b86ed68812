"""The operator's side: command line, plans, sequencer, recording, report.

Six floors, each imports those below and `calib`, `drivers`, `sim`: cli, verbs, views, devices,
sequencer, storage.
"""

import os

# The matrices here are small. Threads of the linear algebra library only wait for each other, a
# hundred times longer than the work takes where another process wants the cores too.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
