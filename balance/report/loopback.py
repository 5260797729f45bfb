"""Pages and answers of this program for one browser on this machine, and for nobody else.

The server listens on 127.0.0.1 alone. Every address begins with a secret of 32 bytes that is drawn anew each time; the
``Host`` must be the server's own, so that no other site's name leads here (DNS rebinding), and a request that changes
anything must be JSON from a page of ours. Names of addresses are looked up in a table, and none is a path of a file.
"""

import json
import re
import secrets
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socket import SHUT_RD, socket
from threading import Timer
from typing import Any
from urllib.parse import parse_qsl

from ..errors import CounterpoiseError, DataError
from ..results import plain
from .page import printable

Answer = Callable[[Mapping[str, str]], Any]
"""What is answered to the words of a request: a page as text, or a document in plain JSON types."""
LARGEST_BODY = 1 << 16
"""Of a request [bytes]."""
PATIENCE_S = 30.0
"""Within which a request must be whole, however slowly it comes."""
_HEADERS = {
    "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY", "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}  # fmt: skip


class Loopback(ThreadingHTTPServer):
    """Answers by name, to be read (``pages``) or that change something (``actions``, by POST)."""

    daemon_threads = True
    timeout = 0.2

    def __init__(self, pages: Mapping[str, Answer], actions: Mapping[str, Answer] | None = None, port: int = 0) -> None:
        self.token, self.answers = secrets.token_urlsafe(32), {"GET": pages, "POST": actions or {}}
        self.asked = time.monotonic()
        try:
            super().__init__(("127.0.0.1", port), _Handler)
        except OSError as error:
            raise DataError(f"port {port} of this machine: {error.strerror}; name another, or none") from error
        self.hosts = {f"{name}:{self.server_port}" for name in ("127.0.0.1", "localhost")}

    @property
    def url(self) -> str:
        """Where the first page is."""
        return f"http://127.0.0.1:{self.server_port}/{self.token}/"

    def serve(self, idle: float = float("inf")) -> None:
        """Answer until interrupted, or until nobody asked for ``idle`` seconds."""
        with self:
            while time.monotonic() - self.asked < idle:
                self.handle_request()

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ANN401
        """Nothing where who asked broke off; all else is told on the terminal."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: Loopback
    timeout = PATIENCE_S

    def handle(self) -> None:
        """Answer a request; one that is not whole in time ends where it is."""
        limit = Timer(PATIENCE_S, _read_no_more, [self.connection])
        limit.daemon = True
        limit.start()
        try:
            super().handle()
        finally:
            limit.cancel()

    def do_GET(self) -> None:
        """Answer what is read."""
        self._answer("GET", {})

    def do_POST(self) -> None:
        """Answer what changes something: one JSON object of texts."""
        origin, kind = self.headers.get("Origin"), self.headers.get("Content-Type", "")
        size = self.headers.get("Content-Length", "")
        if kind.partition(";")[0] != "application/json" or (
            origin and origin.removeprefix("http://") not in self.server.hosts
        ):
            return self._send(403, {"error": "expected JSON from a page of this program"})
        if not re.fullmatch("[0-9]{1,9}", size) or int(size) > LARGEST_BODY:
            return self._send(413, {"error": f"expected at most {LARGEST_BODY} bytes"})
        try:
            words = json.loads(self.rfile.read(int(size)))
        except (ValueError, RecursionError):
            words = None
        if not isinstance(words, dict) or not all(isinstance(word, str) for word in words.values()):
            return self._send(400, {"error": "expected a JSON object of texts"})
        return self._answer("POST", words)

    def _answer(self, method: str, words: Mapping[str, str]) -> None:
        place, _, query = self.path.partition("?")
        token, _, name = place.removeprefix("/").partition("/")
        if self.headers.get("Host") not in self.server.hosts:
            return self._send(403, {"error": "no such host"})
        if not secrets.compare_digest(token.encode(), self.server.token.encode()):
            return self._send(403, {"error": "wrong token: open the address that the command printed"})
        self.server.asked = time.monotonic()
        if name not in self.server.answers[method]:
            return self._send(404, {"error": "no such page"})
        try:
            found = self.server.answers[method][name]({**dict(parse_qsl(query)), **words})
        except CounterpoiseError as error:
            return self._send(422, {"error": str(error)})
        except (LookupError, ValueError) as error:
            return self._send(400, {"error": f"not understood: {error}"})
        return self._send(200, found)

    def _send(self, status: int, found: Any) -> None:  # noqa: ANN401
        page = isinstance(found, str)
        text = found if page else json.dumps(printable(plain(found)), allow_nan=False)
        body = text.encode("utf-8", "backslashreplace")
        self.send_response(status)
        kind = "text/html" if page else "application/json"
        for name, value in {**_HEADERS, "Content-Type": f"{kind}; charset=utf-8", "Content-Length": len(body)}.items():
            self.send_header(name, str(value))
        with suppress(ConnectionError):  # who asked has gone
            self.end_headers()
            self.wfile.write(body)

    def version_string(self) -> str:
        """Nothing of what runs here."""
        return "counterpoise"

    def log_message(self, *_: Any) -> None:  # noqa: ANN401
        """Nothing: addresses hold the secret."""


def _read_no_more(connection: socket) -> None:
    with suppress(OSError):  # it is closed
        connection.shutdown(SHUT_RD)
