"""The page's few routes, and who may use them."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
from collections.abc import AsyncIterator, Callable
from importlib.resources import files

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import (
    HTMLResponse,
    JSONResponse,
    PlainTextResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Route

from cell.views.page.address import Address
from cell.views.page.live_run import LiveRun, Part
from cell.views.page.picture import jpeg

OWN_HEADER = "x-cell-page"
"""A page of elsewhere cannot set it without asking first, and is never answered."""

MOST_STREAMS = 64
"""Of the connections that the page has; what is left is for the buttons."""
_TICK_S = 0.2


class Page:
    """The application.

    Parameters
    ----------
    live:
        The run.
    address:
        Who is let in.

    Attributes
    ----------
    streams:
        How many browsers follow the run now.
    closing:
        Once true, every stream sends what is new and ends.
    """

    def __init__(self, live: LiveRun, address: Address) -> None:
        self.streams = 0
        self.closing = False
        self._live, self._address = live, address
        self._html, self._policy = _document()
        self._encoded: tuple[int, bytes] = (0, b"")
        self._events_encoded: dict[str, tuple[int, str]] = {}

    def application(self) -> Starlette:
        """The routes, each behind `_let_in`."""
        gets = {"/": self._page, "/events": self._events, "/frame.jpg": self._frame}
        posts = {
            "/stop": self._stop,
            "/pause": self._pause,
            "/go-on": self._go_on,
            "/skip": self._skip,
        }
        routes = [Route(path, self._let_in(answer)) for path, answer in gets.items()]
        routes += [
            Route(path, self._let_in(answer), methods=["POST"]) for path, answer in posts.items()
        ]
        return Starlette(routes=routes)

    def _let_in(self, answer: Callable[[Request], object]) -> Callable[[Request], object]:
        async def guarded(request: Request) -> object:
            refusal = self._refusal(request)
            if refusal:
                return PlainTextResponse(f"{refusal}\n", 403)
            response = await answer(request)  # type: ignore[misc]
            response.headers.update(
                {
                    "cache-control": "no-store",
                    "content-security-policy": self._policy,
                    "referrer-policy": "no-referrer",
                    "x-content-type-options": "nosniff",
                    "x-frame-options": "DENY",
                }
            )
            return response

        return guarded

    def _refusal(self, request: Request) -> str:
        """Why the request is not answered, or nothing."""
        host = request.headers.get("host", "")
        if not self._address.admits(request.query_params.get("token", ""), host):
            return "The token is missing or wrong: open the address that `cell run` printed."
        if request.method == "POST":
            origin = request.headers.get("origin")
            if origin is not None and origin.partition("://")[2] != host:
                return "Only this page itself may press its buttons."
            if OWN_HEADER not in request.headers:
                return f"The header {OWN_HEADER} is missing."
        return ""

    # -- what is shown ---------------------------------------------------------------------------

    async def _page(self, request: Request) -> Response:
        return HTMLResponse(self._html)

    async def _frame(self, request: Request) -> Response:
        """The newest picture; 404 for an older one, whose corners would not fit it."""
        picture = self._live.picture
        if picture is None or request.query_params.get("number") != str(picture[0]):
            return PlainTextResponse("there is a newer frame\n", 404)
        number, image = picture
        if self._encoded[0] != number:
            self._encoded = number, await run_in_threadpool(jpeg, image)
        return Response(self._encoded[1], media_type="image/jpeg")

    async def _events(self, request: Request) -> Response:
        if self.streams >= MOST_STREAMS:
            return PlainTextResponse("too many browsers follow this run\n", 503)
        return StreamingResponse(self._follow(), media_type="text/event-stream")

    async def _follow(self) -> AsyncIterator[str]:
        """Server-sent events: what is new, never what a slow browser has missed meanwhile."""
        sent: dict[str, int] = {}
        self.streams += 1
        try:
            yield "retry: 1000\n\n"
            while True:
                last = self.closing
                yield self._news(sent)
                if last:
                    return
                await asyncio.sleep(_TICK_S)
        finally:
            self.streams -= 1

    def _news(self, sent: dict[str, int]) -> str:
        parts = dict(self._live.parts)
        new = {name: p for name, p in parts.items() if sent.get(name) != p.version}
        sent.update({name: part.version for name, part in new.items()})
        reported = [self._event(name, part) for name, part in new.items()]
        return "".join([*reported, _event("now", self._live.now())])

    def _event(self, name: str, part: Part) -> str:
        """A part as it is sent; encoded once, however many follow."""
        version, text = self._events_encoded.get(name, (-1, ""))
        if version != part.version:
            text = _event(name, part.content)
            self._events_encoded[name] = part.version, text
        return text

    # -- what is asked ---------------------------------------------------------------------------

    async def _stop(self, request: Request) -> Response:
        self._live.stop.ask("the page's Stop button")
        return self._answer("Stop asked: the arm stops before all else.")

    async def _pause(self, request: Request) -> Response:
        self._live.requests.pause()
        return self._answer("Pause asked: the arm stands at the end of its move and waits.")

    async def _go_on(self, request: Request) -> Response:
        self._live.requests.go_on()
        return self._answer("Going on.")

    async def _skip(self, request: Request) -> Response:
        """Give the view up that the operator saw; a click that comes late skips no other one."""
        status, asked = self._live.status, request.query_params.get("view", "")
        if status is None or asked != str(status.index):
            text = "The run is at another view by now; nothing was skipped."
            return JSONResponse({"words": text}, 409)
        self._live.requests.skip(int(asked))
        return self._answer(f"{status.view} is given up.")

    def _answer(self, text: str) -> Response:
        if self._live.over:
            return JSONResponse({"words": "The run is over; the arm was let go of."}, 409)
        return JSONResponse({"words": text})


def _event(name: str, content: object) -> str:
    return f"event: {name}\ndata: {json.dumps(content)}\n\n"


def _document() -> tuple[str, str]:
    """The page as one document, and the policy that lets a browser run nothing else."""
    room = files("cell.views.page")
    html, css, js = (
        room.joinpath(f"page.{kind}").read_text(encoding="utf-8") for kind in ("html", "css", "js")
    )
    policy = (
        f"default-src 'none'; style-src {_hash(css)}; script-src {_hash(js)}; img-src 'self' data:;"
        " connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return html.replace("/*page.css*/", css).replace("/*page.js*/", js), policy


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
