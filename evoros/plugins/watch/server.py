"""The page and its server, which accepts only local requests with a secret in the URL."""

import hashlib
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hmac import compare_digest
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import TCPServer
from threading import BoundedSemaphore
from typing import Any

from markupsafe import Markup

from evoros.analysis.report import frame
from evoros.analysis.report.page import SCRIPTS
from evoros.base.errors import InputError
from evoros.plugins.watch.folders import Look
from evoros.session.status import COLUMNS, Overview, list_cells, write_clock
from evoros.storage.layout import FINISHED, RUNNING

WORDS = ("run", "state")  # columns without numbers
SCRIPT = frame.read_scripts([*SCRIPTS, "live"])
POLICY = frame.write_policy(SCRIPT, "'self'")
HTML, JSON = "text/html; charset=utf-8", "application/json"


@dataclass(frozen=True)
class Content:
    """The content at an address."""

    kind: str
    data: bytes
    digest: str


@dataclass(frozen=True)
class Contents:
    """The contents of all addresses; unchanged parts are not rendered again."""

    title: str
    parts: Mapping[str, Content]
    state: Content

    def find(self, address: str) -> Content | None:
        """Return the content at an address: ``""`` for the page, ``part/ID`` for a part of it."""
        if not address:
            return self._assemble()
        kind, _, key = address.partition("/")
        return self.parts.get(key) if kind == "part" else {"state": self.state}.get(address)

    def _assemble(self) -> Content:
        parts = {key: Markup(part.data.decode()) for key, part in self.parts.items()}
        known = Markup('{}\n<script type="application/json" data-state>{}</script>')
        looked = Markup(self.state.data.decode().replace("<", "\\u003c"))
        parts[frame.MISSIONS] = known.format(parts[frame.MISSIONS], looked)
        return _make(HTML, frame.assemble(self.title, parts, SCRIPT, POLICY, ("style", "live")))


def draw_parts(page: frame.Page) -> dict[str, Content]:
    """Render the parts of a page, keyed by id."""
    return {key: _make(HTML, part) for key, part in frame.render_parts(page).items()}


def make_contents(
    title: str,
    drawn: Mapping[str, Content],
    progress: tuple[str, Markup],
    state: Mapping[str, object],
) -> Contents:
    """Return the contents of a page with an updated section ``progress``."""
    parts = {**drawn, frame.name_section(progress[0]): _make(HTML, frame.render_section(*progress))}
    digests = [(key, part.digest) for key, part in parts.items()]
    return Contents(title, parts, _make(JSON, json.dumps({**state, "parts": digests})))


def _make(kind: str, text: str) -> Content:
    data = text.encode()
    return Content(kind, data, hashlib.sha256(data).hexdigest()[:16])


def render_progress(look: Look, trouble: str) -> Markup:
    """Render the progress section; ``trouble`` is why figures are missing."""
    runs = look.overviews
    heads = [(name, name not in WORDS) for name in ("run", *COLUMNS)]
    table = frame.Table(heads, [(look.names[run.path], *list_cells(run)) for run in runs])
    shares = [min(1.0, run.done / run.wanted) if run.wanted else 0.0 for run in runs]
    return frame.render(
        "progress.html",
        tiles=list(_list_tiles(runs, look.names)),
        share=sum(shares) / len(runs) if runs else None,
        table=table if len(runs) > 1 else None,
        reasons=[f"{look.names[run.path]}: {run.reason}" for run in runs if run.reason],
        empty=[str(path) for path in look.empty],
        trouble=trouble,
        log=look.log,
    )


def describe_state(runs: Sequence[Overview]) -> str:
    """Return the first of these states that any run has: running, unfinished states, finished."""
    states = [run.state for run in runs]
    ordered = (RUNNING, *(state for state in states if state != FINISHED), FINISHED)
    return next((state for state in ordered if state in states), "waiting")


def _list_tiles(
    runs: Sequence[Overview], names: Mapping[Path, str]
) -> Iterator[tuple[str, str, str]]:
    yield "state", describe_state(runs), ""
    if not runs:
        return
    if len(runs) == 1:
        yield runs[0].units, f"{runs[0].done}", f"of {runs[0].wanted}" if runs[0].wanted else ""
    else:
        finished = [run.state for run in runs].count(FINISHED)
        yield "finished", f"{finished}", f"of {len(runs)} started"
    best = max(runs, key=lambda run: -1e300 if run.best is None else run.best)
    if best.best is not None:
        fresh = "" if best.validated is None else f"{best.validated:.3f} validated"
        yield "best fitness", f"{best.best:.3f}", names[best.path] if len(runs) > 1 else fresh
    yield "missions", f"{sum(run.missions for run in runs):,}", ""
    speeds = [run.speed for run in runs if run.speed is not None and run.state == RUNNING]
    if speeds:
        yield "simulated s/s", f"{sum(speeds):,.0f}", ""
    left = [run.left_s for run in runs if run.left_s is not None]
    if left:
        yield "time left", write_clock(max(left)), "of running runs" if len(runs) > 1 else ""


HOST = "127.0.0.1"
NAMES = (HOST, "localhost")  # accepted host names; a DNS rebinding attack uses another name
AT_ONCE = 32  # maximum number of simultaneous connections
SILENT_S = 20.0  # time [s] after which an idle connection is closed
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
    """A server on the loopback interface that requires a token."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = AT_ONCE

    def __init__(self, port: int, token: str, give: Callable[[], Contents]) -> None:
        self.token, self.give = token.encode(), give
        self._free = BoundedSemaphore(AT_ONCE)
        super().__init__((HOST, port), _Handler)

    @property
    def address(self) -> str:
        """The URL of the page."""
        return f"http://{HOST}:{self.server_port}/{self.token.decode()}/"

    def server_bind(self) -> None:
        """Bind the socket without looking up the host name."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = HOST, int(self.server_address[1])

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread, or close it if there are too many connections."""
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
        """Ignore lost connections; report other errors."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


def open_server(port: int, token: str, give: Callable[[], Contents]) -> Server:
    """Open the server on a port; 0 for any free port."""
    try:
        return Server(port, token, give)
    except OSError as error:
        fix = "choose another port, or leave --port out"
        raise InputError(f"--port: {port} cannot be opened ({error.strerror}); {fix}") from error


class _Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "evoros", ""
    timeout = SILENT_S

    def do_POST(self) -> None:
        """Reject the request; the server changes nothing."""
        self.send_error(HTTPStatus.METHOD_NOT_ALLOWED)

    do_PUT = do_DELETE = do_PATCH = do_OPTIONS = do_TRACE = do_CONNECT = do_POST  # noqa: N815

    def do_GET(self) -> None:
        """Send the content at an address; in reply to HEAD, send only the headers."""
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

    do_HEAD = do_GET  # noqa: N815

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
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
        """Do nothing; a log would contain the token, which is part of the path."""
