"""EGM feedback: joints and flange pose of one instant, up to 250 times a second.

The controller sends them to a UDP port of this host while a motion program runs. The pose is that
of tool0 in the world, since the motion programs use tool0 and wobj0.
"""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.abb.readings import Reading
from drivers.abb.units import transform_of
from drivers.errors import DeviceRefused

_FRESH_S = 0.1
_WAIT_S = 0.1


class EgmReader:
    """Receives in a thread of its own.

    Parameters
    ----------
    port:
        UDP port; raises `DeviceRefused` where another program holds it.
    base_from_world:
        See `drivers.abb.readings.world_from_base`.
    """

    def __init__(self, port: int, base_from_world: RigidTransform) -> None:
        try:
            from ABBRobotEGM import EGM

            self._egm = EGM(port=port)
        except ImportError as error:
            raise DeviceRefused(f"EGM: {error}: pip install 'calibration-cell[abb]'") from None
        except OSError as error:
            raise DeviceRefused(
                f"EGM: UDP port {port} cannot be opened ({error}): close the other program that "
                "listens there, or choose another port on both sides"
            ) from None
        self._base_from_world = base_from_world
        self._newest: Reading | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._receive, name="abb-egm", daemon=True)
        self._thread.start()

    def fresh(self) -> Reading | None:
        """Return the newest reading, or None where the stream is not running."""
        reading = self._newest
        if reading is None or time.monotonic() - reading.host_t_s > _FRESH_S:
            return None
        return reading

    def close(self) -> None:
        """End the thread and free the port."""
        self._closing.set()
        self._thread.join(timeout=1.0)
        self._egm.close()

    def _receive(self) -> None:
        while not self._closing.is_set():
            received, message = self._egm.receive_from_robot(timeout=_WAIT_S)
            if received and message.cartesian is not None and len(message.joint_angles) == 6:
                self._newest = self._reading(message)

    def _reading(self, message: Any) -> Reading:
        mm, wxyz = np.array(message.cartesian.pos), np.array(message.cartesian.orient)
        return Reading(
            host_t_s=time.monotonic(),
            controller_t_s=message.header.tm / 1000.0,
            joints_rad=tuple(np.radians(message.joint_angles).tolist()),
            base_from_flange=self._base_from_world * transform_of(mm, wxyz),
            external=(),
            configuration=(),
            raw={
                "source": "egm",
                "seqno": message.header.seqno,
                "joints_deg": message.joint_angles.tolist(),
                "trans_mm": mm.tolist(),
                "rot_wxyz": wxyz.tolist(),
            },
        )
