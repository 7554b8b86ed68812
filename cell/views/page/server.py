"""The page's server: a thread of its own that the run neither waits for nor needs."""

from __future__ import annotations

import logging
import threading
import time
from types import TracebackType

import uvicorn

from cell.errors import InputError
from cell.views.page.address import Address
from cell.views.page.application import Page
from cell.views.page.live_run import LiveRun

log = logging.getLogger(__name__)

_START_S = 10.0
_FAREWELL_S = 1.5
_END_S = 3.0
_POLL_S = 0.02


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
        config = uvicorn.Config(
            self._page.application(),
            log_level="critical",
            access_log=False,
            lifespan="off",
            loop="asyncio",
            http="h11",
            ws="none",
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
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
