"""The page's server: a thread of its own that the run neither waits for nor needs."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from types import TracebackType

import uvicorn

from cell.errors import InputError
from cell.views.page.address import Address
from cell.views.page.application import Page
from cell.views.page.connections import Door, GuardedProtocol
from cell.views.page.live_run import LiveRun

log = logging.getLogger(__name__)

_START_S = 10.0
_FAREWELL_S = 1.5
_END_S = 3.0
_POLL_S = 0.02
_KEEP_ALIVE_S = 60
"""A tablet's Stop goes through the connection that it has, past whoever else wants in."""
_HEADER_BYTES = 16_384


class _Server(uvicorn.Server):
    """Serves who is let in at the door."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Open the door in the place of uvicorn's own listening."""
        await super().startup(sockets=[])
        (listener,) = list(sockets or [])
        door = Door(listener, self.server_state.connections, self._protocol)
        self._door = asyncio.ensure_future(door.run())

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close the door first."""
        self._door.cancel()
        await super().shutdown(sockets=sockets)

    def _protocol(self) -> GuardedProtocol:
        return GuardedProtocol(
            config=self.config, server_state=self.server_state, app_state=self.lifespan.state
        )


class LivePage:
    """Serves a run's page while the context holds.

    Raises
    ------
    InputError
        On entering: the address cannot be had, or the server does not start.
    """

    def __init__(self, live: LiveRun, address: Address) -> None:
        self._address = address
        self._page = Page(live, address)
        # who comes in is decided at the door; uvicorn serves who is in
        config = uvicorn.Config(
            self._page.application(),
            log_level="critical",
            access_log=False,
            lifespan="off",
            loop="asyncio",
            http=GuardedProtocol,
            timeout_keep_alive=_KEEP_ALIVE_S,
            h11_max_incomplete_event_size=_HEADER_BYTES,
            ws="none",
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        self._server = _Server(config)
        self._thread = threading.Thread(target=self._serve, name="page", daemon=True)

    def __enter__(self) -> str:
        """Listen; returns what to type into a browser."""
        self._socket = self._address.listen()
        self._thread.start()
        began_s = time.monotonic()
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() - began_s > _START_S:
                self._socket.close()
                raise InputError("the live page does not start; leave --page away")
            time.sleep(_POLL_S)
        return self._address.url(self._socket.getsockname()[1])

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Let every browser hear how it ended, as far as it listens, then go."""
        self._page.closing = True
        began_s = time.monotonic()
        while self._page.streams and time.monotonic() - began_s < _FAREWELL_S:
            time.sleep(_POLL_S)
        self._server.should_exit = True
        self._thread.join(_END_S)
        self._socket.close()

    def _serve(self) -> None:
        try:
            self._server.run(sockets=[self._socket])
        except Exception as fault:
            log.warning("the live page has ended (%s); the run goes on", fault)
