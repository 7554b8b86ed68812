"""The page's connections: few, each with its time, so that no flood holds a run up.

Strangers may open connections faster than anybody can answer, send half a request, or read nothing.
Descriptors are what arm, camera and recording need too; so there is a cap on connections, per
address and in all, a rate at which an address may open new ones, and a time for a request to be
whole and for an answer to be taken. Whoever was answered once is not pushed out by who was not; but
one that stays in and asks nothing makes room where none is left, beginning with whoever has most.
"""

from __future__ import annotations

import asyncio
import resource
import socket
import struct
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_OPEN = 96
"""Connections in all."""
MOST_OF_ADDRESS = 32
"""Of one address: a browser has six, and a desk may have several."""
REQUEST_S = 3.0
"""A request is whole, its body too, so soon after its first byte (or the connection)."""
ANSWER_S = 10.0
"""An answer that nobody takes is given up after so long."""
_RATE_HZ, _BURST = 50.0, 200.0
"""New connections of one address, in the long run and at once."""
_SHARE_OF_DESCRIPTORS = 4
_SWEEP_S = 0.25
_TURN = 32
_MOST_ADDRESSES = 1000
_RESET = struct.pack("ii", 1, 0)


class GuardedProtocol(H11Protocol):
    """An HTTP connection that remembers what it waits for.

    Attributes
    ----------
    waits_since_s:
        Loop time since when a request has been incomplete, or None.
    stuck_since_s:
        Loop time since when an answer has not been taken, or None.
    served:
        Whether it was answered once.
    """

    waits_since_s: float | None = None
    stuck_since_s: float | None = None
    served = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first request."""
        super().connection_made(transport)
        self.waits_since_s = self.loop.time()

    def data_received(self, data: bytes) -> None:
        """Take in a part of a request; a whole one waits for nothing any more."""
        if self.waits_since_s is None:
            self.waits_since_s = self.loop.time()
        super().data_received(data)
        if self._whole:
            self.waits_since_s = None

    def on_response_complete(self) -> None:
        """Note that it was answered."""
        self.served = True
        if self._whole:
            self.waits_since_s = None
        super().on_response_complete()

    @property
    def _whole(self) -> bool:
        return self.cycle is not None and not self.cycle.more_body

    @property
    def idle(self) -> bool:
        """Whether it was answered and asks nothing now; a browser opens another when it does."""
        return self.served and self.cycle is not None and bool(self.cycle.response_complete)

    @property
    def address(self) -> str:
        """Whose it is."""
        return self.client[0] if self.client else ""

    def overdue(self, now_s: float) -> bool:
        """Whether it has kept us waiting for too long."""
        if self.transport.get_write_buffer_size() == 0:
            self.stuck_since_s = None
        elif self.stuck_since_s is None:
            self.stuck_since_s = now_s
        waits, stuck = self.waits_since_s, self.stuck_since_s
        return (waits is not None and now_s - waits > REQUEST_S) or (
            stuck is not None and now_s - stuck > ANSWER_S
        )


@dataclass
class _Bucket:
    """New connections that an address may open at once."""

    left: float
    at_s: float

    def take(self, now_s: float) -> bool:
        self.left = min(_BURST, self.left + _RATE_HZ * (now_s - self.at_s))
        self.at_s = now_s
        if self.left < 1.0:
            return False
        self.left -= 1.0
        return True


class Door:
    """Lets connections in, and shows out those that are overdue.

    Parameters
    ----------
    listener:
        The listening socket.
    connections:
        The server's open connections.
    make:
        Makes a protocol for a new one.
    """

    def __init__(
        self,
        listener: socket.socket,
        connections: Iterable[Any],
        make: Callable[[], GuardedProtocol],
    ) -> None:
        self._listener, self._connections, self._make = listener, connections, make
        self._buckets: dict[str, _Bucket] = {}
        soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        self._most = max(8, min(MOST_OPEN, soft // _SHARE_OF_DESCRIPTORS))

    async def run(self) -> None:
        """Let in and show out until cancelled."""
        self._listener.setblocking(False)
        await asyncio.gather(self._let_in(), self._show_out())

    async def _let_in(self) -> None:
        loop = asyncio.get_running_loop()
        taken = 0
        while True:
            try:
                connection, peer = await loop.sock_accept(self._listener)
            except OSError:  # no descriptor left, or the stranger has gone meanwhile
                self._push_out(self._open())
                await asyncio.sleep(_SWEEP_S)
                continue
            if self._admits(peer[0], loop.time()):
                with suppress(OSError):
                    await loop.connect_accepted_socket(self._make, connection)
            else:
                _reset(connection)
            taken += 1
            if taken % _TURN == 0:
                await asyncio.sleep(0)  # who is in is answered meanwhile

    async def _show_out(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await asyncio.sleep(_SWEEP_S)
            for protocol in self._open():
                if protocol.overdue(loop.time()):
                    protocol.transport.abort()

    def _open(self) -> list[GuardedProtocol]:
        return [p for p in self._connections if not p.transport.is_closing()]

    def _admits(self, address: str, now_s: float) -> bool:
        if len(self._buckets) > _MOST_ADDRESSES:
            self._buckets.clear()
        if not self._buckets.setdefault(address, _Bucket(_BURST, now_s)).take(now_s):
            return False
        held = self._open()
        own = [protocol for protocol in held if protocol.address == address]
        if len(own) >= MOST_OF_ADDRESS and not self._push_out(own):
            return False
        if len(held) < self._most:
            return True
        counts = Counter(protocol.address for protocol in held)
        most = max(counts, key=counts.__getitem__)
        return self._push_out([protocol for protocol in held if protocol.address == most])

    def _push_out(self, held: Iterable[GuardedProtocol]) -> bool:
        """Close the one that has waited longest without an answer, or else one that is idle.

        False where all are being answered.
        """
        held = list(held)
        waiting = [p for p in held if not p.served and p.waits_since_s is not None]
        idle = [p for p in held if p.idle]
        if not waiting and not idle:
            return False
        out = min(waiting, key=lambda p: p.waits_since_s or 0.0) if waiting else idle[0]
        out.transport.abort()
        return True


def _reset(connection: socket.socket) -> None:
    with suppress(OSError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
    connection.close()
