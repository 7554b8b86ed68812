"""HTTP requests to a device, each within a deadline for the whole of it, and of a bounded size."""

from __future__ import annotations

import http.client
import time

_CHUNK_BYTES = 1 << 16


class NoAnswer(Exception):
    """Nothing that can be used came; the message is our own, without the other's bytes.

    Attributes
    ----------
    cut_short:
        An answer began and did not end.
    """

    def __init__(self, why: str, *, cut_short: bool = False) -> None:
        super().__init__(why)
        self.cut_short = cut_short


class BoundedHttp:
    """One keep-alive connection.

    Parameters
    ----------
    host, port:
        Of the server.
    largest_bytes:
        An answer with more is given up.
    """

    def __init__(self, host: str, port: int, largest_bytes: int) -> None:
        self._connection = http.client.HTTPConnection(host, port)
        self._largest_bytes = largest_bytes

    def ask(
        self, verb: str, path: str, deadline_s: float, body: str | None = None, kind: str = ""
    ) -> tuple[int, bytes]:
        """Return status and body of an answer.

        Parameters
        ----------
        verb, path, body:
            Of the request.
        deadline_s:
            On the monotonic clock, for the whole answer.
        kind:
            Content type of the body.

        Raises
        ------
        NoAnswer
            It did not come, was cut short, is too large, or is no HTTP.
        """
        reused = self._connection.sock is not None
        try:
            try:
                return self._once(verb, path, deadline_s, body, kind)
            except (http.client.RemoteDisconnected, BrokenPipeError, ConnectionResetError):
                # a server may close an idle connection at any time: that is no fault yet
                if not reused:
                    raise
                self._connection.close()
                return self._once(verb, path, deadline_s, body, kind)
        except (OSError, http.client.HTTPException) as error:
            self._connection.close()
            cut_short = isinstance(error, http.client.IncompleteRead)
            raise NoAnswer(_reason(error), cut_short=cut_short) from None

    def close(self) -> None:
        """Close the connection. Idempotent."""
        self._connection.close()

    def _once(
        self, verb: str, path: str, deadline_s: float, body: str | None, kind: str
    ) -> tuple[int, bytes]:
        self._limit(deadline_s)
        self._connection.request(verb, path, body, {"Content-Type": kind} if body else {})
        self._limit(deadline_s)
        answer = self._connection.getresponse()
        parts, size_bytes = [], 0
        while chunk := answer.read1(_CHUNK_BYTES):
            parts.append(chunk)
            size_bytes += len(chunk)
            if size_bytes > self._largest_bytes:
                raise http.client.HTTPException
            self._limit(deadline_s)
        missing_bytes = answer.length
        answer.close()
        whole = b"".join(parts)
        if missing_bytes:
            raise http.client.IncompleteRead(whole, missing_bytes)
        return answer.status, whole

    def _limit(self, deadline_s: float) -> None:
        left_s = deadline_s - time.monotonic()
        if left_s <= 0:
            raise TimeoutError("no answer in time")
        self._connection.timeout = left_s
        if self._connection.sock is not None:
            self._connection.sock.settimeout(left_s)


def _reason(error: Exception) -> str:
    if isinstance(error, http.client.HTTPException):
        return f"what answers does not speak HTTP as it should ({type(error).__name__})"
    return str(error) or type(error).__name__
