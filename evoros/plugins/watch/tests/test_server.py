"""The server of the page gives its own contents alone, to those alone who know the address."""

import http.client
import select
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Thread
from urllib.parse import quote

import pytest
from executor_calls import wait_until
from markupsafe import Markup

from evoros.analysis.report.frame import Page
from evoros.base.errors import InputError
from evoros.plugins.watch.server import AT_ONCE, Server, draw_parts, make_contents, open_server

TOKEN = "secret-of-the-address"
SECRET = Path(__file__).name


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    progress = "Progress", Markup()
    contents = make_contents("runs", draw_parts(Page("runs")), progress, {"state": "running"})
    server = open_server(0, TOKEN, lambda: contents)
    Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def ask(
    server: Server, path: str, method: str = "GET", host: str = ""
) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=100)
    connection.request(method, path, headers={"Host": host} if host else {})
    answer = connection.getresponse()
    try:
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


@pytest.mark.parametrize("name", ["", "state", "part/header", "part/links", "part/missions"])
def test_the_page_and_its_parts_are_given_and_no_browser_keeps_or_lends_them(
    server: Server, name: str
) -> None:
    status, headers, data = ask(server, f"/{TOKEN}/{name}")
    assert status == 200
    assert int(headers["Content-Length"]) == len(data) > 0
    assert headers["Cache-Control"] == "no-store"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"  # the address has the secret
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "http" not in policy  # no other origin
    asked, head, body = ask(server, f"/{TOKEN}/{name}", "HEAD")
    del headers["Date"], head["Date"]  # the clock goes on
    assert (asked, head, body) == (status, headers, b"")


@pytest.mark.parametrize(
    "path", ["/", "/state", f"/{TOKEN[:-1]}/", f"/{TOKEN}x/state", "//", f"http://evil/{TOKEN}/"]
)
def test_nothing_is_given_without_the_whole_token(server: Server, path: str) -> None:
    status, _, data = ask(server, path)
    assert (status, data) == (403, b"Forbidden\n")


@pytest.mark.parametrize(
    "name",
    [
        f"../{SECRET}",
        f"../../../../../..{quote(__file__)}",
        f"%2e%2e/{SECRET}",
        f"part/../../{SECRET}",
        quote(__file__),
        "part/",
        "part",
        "state/",
        "page.html",
        "?x=1",
    ],
)
def test_there_are_no_files_and_no_listing(server: Server, name: str) -> None:
    assert ask(server, f"/{TOKEN}/{name}")[0] == 404


@pytest.mark.parametrize(
    "method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT"]
)
def test_nothing_can_be_sent(server: Server, method: str) -> None:
    status, headers, _ = ask(server, f"/{TOKEN}/", method)
    assert status == 405
    assert headers["Allow"] == "GET, HEAD"


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("localhost", 200),
        ("localhost:1", 200),  # a tunnel may have another port
        ("127.0.0.1:80", 200),
        ("evil.example", 403),
        ("evil.example:80", 403),
        ("127.0.0.1.evil.example", 403),
        ("localhost.evil.example:80", 403),
        ("0.0.0.0", 403),
    ],
)
def test_a_name_that_was_bound_to_this_machine_by_others_is_refused(
    server: Server, host: str, status: int
) -> None:
    assert ask(server, f"/{TOKEN}/state", host=host)[0] == status


def test_a_request_without_a_host_and_a_broken_one_are_refused(server: Server) -> None:
    for request, status in (
        (f"GET /{TOKEN}/ HTTP/1.1\r\n\r\n", b"403 Forbidden"),
        ("GET /\u00e9/ HTTP/1.1\r\nHost: localhost\r\n\r\n", b"403 Forbidden"),
        ("nonsense here now\r\n\r\n", b"Bad Request"),
        (f"BREW /{TOKEN}/ HTTP/1.1\r\n\r\n", b"501 Not Implemented"),
    ):
        with socket.create_connection(("127.0.0.1", server.server_port), 20) as connection:
            connection.sendall(request.encode())
            answer = connection.recv(1000)
            assert status in answer
            assert b"<html" not in answer


def test_it_listens_on_the_loopback_interface_alone(server: Server) -> None:
    assert server.socket.getsockname()[0] == "127.0.0.1"
    assert server.address == f"http://127.0.0.1:{server.server_port}/{TOKEN}/"


def test_too_many_connections_are_closed_and_the_next_one_is_served(server: Server) -> None:
    port = server.server_port
    held = [socket.create_connection(("127.0.0.1", port), 100) for _ in range(AT_ONCE + 4)]
    assert wait_until(lambda: len(select.select(held, [], [], 0)[0]) >= 4), "they are closed"
    for connection in held:
        connection.close()

    def is_served() -> bool:
        with suppress(ConnectionError, http.client.HTTPException):
            return ask(server, f"/{TOKEN}/state")[0] == 200
        return False

    assert wait_until(is_served), "the threads of closed connections end"


def test_a_port_in_use_is_refused(server: Server) -> None:
    with pytest.raises(InputError, match=f"--port: {server.server_port} .* choose another"):
        open_server(server.server_port, TOKEN, pytest.fail)
