"""The server of the page: for this machine alone, and for those who have the address."""

import sys
from collections.abc import Callable
from hmac import compare_digest
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from threading import BoundedSemaphore
from typing import Any

from evoros.base.errors import InputError
from evoros.watch.contents import POLICY, Contents

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
"""Names of this machine. A page of others that gives its own name this address uses that name."""
AT_ONCE = 32
"""Maximum number of connections."""
SILENT_S = 20.0
"""A connection that is silent for so long is closed."""
HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": f"{POLICY}; frame-ancestors 'none'",
}


class Server(ThreadingHTTPServer):
    """Gives contents to those who know the token, on the loopback interface."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = AT_ONCE

    def __init__(self, port: int, token: str, give: Callable[[], Contents]) -> None:
        self.token, self.give = token.encode(), give
        self._free = BoundedSemaphore(AT_ONCE)
        super().__init__((HOST, port), _Handler)

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{HOST}:{self.server_port}/{self.token.decode()}/"

    def server_bind(self) -> None:
        """Bind the socket; the name of the machine is not looked up."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = HOST, int(self.server_address[1])

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread, or close it if there are too many."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore that the other side has gone; other errors are faults."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


def open_server(port: int, token: str, give: Callable[[], Contents]) -> Server:
    """Open the server at a port; 0 takes any that is free.

    Raises:
        InputError: the port cannot be opened.
    """
    try:
        return Server(port, token, give)
    except OSError as error:
        raise InputError(
            f"--port: {port} cannot be opened ({error.strerror}); choose another, or leave it out"
        ) from error


class _Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "evoros", ""
    timeout = SILENT_S

    def do_GET(self) -> None:
        """Give a content."""
        self._answer()

    def do_HEAD(self) -> None:
        """Give the headers of a content."""
        self._answer()

    def do_POST(self) -> None:
        """Refuse: nothing can be changed."""
        self.send_error(HTTPStatus.METHOD_NOT_ALLOWED)

    do_PUT = do_DELETE = do_PATCH = do_OPTIONS = do_TRACE = do_CONNECT = do_POST  # noqa: N815

    def _answer(self) -> None:
        host = self.headers.get("Host", "").rpartition(":")
        token, _, name = self.path.removeprefix("/").partition("/")
        known = compare_digest(token.encode("latin-1", "replace"), self.server.token)
        if (host[0] or host[2]) not in NAMES or not known:
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        content = self.server.give().find(name)
        if content is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self._send(HTTPStatus.OK, content.kind, content.data, {"ETag": f'"{content.digest}"'})

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Tell that a request is refused, and close the connection."""
        status = HTTPStatus(code)
        more = {"Connection": "close"}
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            more["Allow"] = "GET, HEAD"
        self._send(status, "text/plain", f"{status.phrase}\n".encode(), more)

    def _send(self, status: HTTPStatus, kind: str, data: bytes, more: dict[str, str]) -> None:
        self.send_response(status)
        length = {"Content-Type": kind, "Content-Length": str(len(data))}
        for name, value in {**length, **HEADERS, **more}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Log no requests: their paths have the token."""
