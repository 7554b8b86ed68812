"""EGM feedback: joints and flange pose of one instant, up to 250 times a second.

The controller sends them to a UDP port of this host while a motion program runs. The pose is that
of tool0 in the world, since the motion programs use tool0 and wobj0. Anybody can send to a UDP
port: only what comes from the controller's own address, in order and plausible, is a reading. The
rest is dropped, counted and reported once for each reason; it never ends the thread that receives.
"""

from __future__ import annotations

import logging
import re
import socket
import threading
import time
from collections import Counter
from collections.abc import Sequence
from urllib.parse import urlsplit

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.abb.egm_message import EgmDecoder, EgmMessage, NotBelieved
from drivers.abb.readings import Reading
from drivers.abb.units import transform_of
from drivers.errors import DeviceRefused, DeviceUnreachable

_log = logging.getLogger("cell.drivers")
_FRESH_S = 0.1
_WAIT_S = 0.1
_LARGEST_DATAGRAM = 65536
_WRAPS, _HALF = 2**32, 2**31


class EgmReader:
    """Receives in a thread of its own.

    Parameters
    ----------
    port:
        UDP port; raises `DeviceRefused` where another program holds it.
    url:
        Of the controller, whose address is the only one that is listened to; raises
        `DeviceUnreachable` where its name is not known.
    base_from_world:
        See `drivers.abb.readings.world_from_base`.
    limits_rad:
        Lowest and highest angle of each joint, radians.

    Attributes
    ----------
    refused:
        How many datagrams were dropped, by reason.
    """

    def __init__(
        self,
        port: int,
        url: str,
        base_from_world: RigidTransform,
        limits_rad: Sequence[tuple[float, float]],
    ) -> None:
        self._decoder = EgmDecoder(limits_rad)
        self._senders = _addresses(url)
        self._link = _bound(port)
        self._base_from_world = base_from_world
        self._newest: Reading | None = None
        self._last: EgmMessage | None = None
        self.refused: Counter[str] = Counter()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._receive, name="abb-egm", daemon=True)
        self._thread.start()

    def fresh(self) -> Reading | None:
        """Return the newest reading, or None where the stream is not running."""
        reading = self._newest
        return reading if reading is not None and _age_s(reading) <= _FRESH_S else None

    def close(self) -> None:
        """End the thread and free the port."""
        self._closing.set()
        self._thread.join(timeout=1.0)
        self._link.close()

    def _receive(self) -> None:
        while not self._closing.is_set():
            try:
                datagram, (sender, *_) = self._link.recvfrom(_LARGEST_DATAGRAM)
                self._take(datagram, sender)
            except TimeoutError:
                continue
            except NotBelieved as why:
                self._refuse(str(why))
            except OSError as error:
                self._refuse(f"the port fails ({error})")
                self._closing.wait(_WAIT_S)

    def _take(self, datagram: bytes, sender: str) -> None:
        if sender not in self._senders:
            raise NotBelieved(f"it comes from {sender}, not from {' or '.join(self._senders)}")
        message = self._decoder.decode(datagram)
        if self._last is not None:
            # a stream that was silent is a new one and counts anew; the clock goes on all the same
            _check_clock(self._last, message)
            if self.fresh() is not None:
                _check_number(self._last, message)
        self._last, self._newest = message, self._reading(message)

    def _refuse(self, why: str) -> None:
        # one kind of fault counts once, whatever its numbers
        kind = re.sub(r"-?\d[\d.e+-]*", "#", why)
        self.refused[kind] += 1
        if self.refused[kind] == 1:
            _log.warning(
                "EGM: a datagram is not believed: %s. Others like it are dropped without a word; "
                "the EGM device of the controller must send from the address in the cell file, "
                "and nobody else to this port",
                why,
            )

    def _reading(self, message: EgmMessage) -> Reading:
        pose = transform_of(np.array(message.mm), np.array(message.wxyz))
        return Reading(
            host_t_s=time.monotonic(),
            controller_t_s=message.clock_ms / 1000.0,
            joints_rad=tuple(np.radians(message.joints_deg).tolist()),
            base_from_flange=self._base_from_world * pose,
            external=(),
            configuration=(),
            raw={
                "source": "egm",
                "seqno": message.number,
                "joints_deg": list(message.joints_deg),
                "trans_mm": list(message.mm),
                "rot_wxyz": list(message.wxyz),
                "datagrams_refused": self.refused.total(),
            },
        )


def _check_number(last: EgmMessage, message: EgmMessage) -> None:
    if not 0 < (message.number - last.number) % _WRAPS < _HALF:
        raise NotBelieved(f"its sequence number {message.number} comes after {last.number}")


def _check_clock(last: EgmMessage, message: EgmMessage) -> None:
    if not 0 < (message.clock_ms - last.clock_ms) % _WRAPS < _HALF:
        raise NotBelieved(
            f"the controller's clock does not go on ({message.clock_ms} ms after {last.clock_ms})"
        )


def _age_s(reading: Reading) -> float:
    return time.monotonic() - reading.host_t_s


def _addresses(url: str) -> tuple[str, ...]:
    host = urlsplit(url).hostname or url
    try:
        found = socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_DGRAM)
    except OSError as error:
        raise DeviceUnreachable(f"ABB arm {url}: its name is not known here ({error})") from None
    return tuple(sorted({str(address[0]) for *_, address in found}))


def _bound(port: int) -> socket.socket:
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.settimeout(_WAIT_S)
    try:
        link.bind(("", port))
    except OSError as error:
        link.close()
        raise DeviceRefused(
            f"EGM: UDP port {port} cannot be opened ({error}): close the other program that "
            "listens there, or choose another port on both sides"
        ) from None
    return link
