"""The subcommand ``watch``, which serves a live web page about runs until Ctrl-C."""

import os
import signal
from collections.abc import Sequence
from pathlib import Path
from secrets import token_urlsafe
from threading import Thread
from typing import NoReturn

from evoros.base.errors import EvorosError, InputError
from evoros.files.resources import expand_home
from evoros.terminal.console import CommandParser, print_result, reports_errors

NAME = "evoros watch"
ABOUT = """Show runs, evaluations and sweeps on a live browser page, without writing files. The
printed address works only on this machine and contains a secret; press Ctrl-C to stop."""
LAST_PORT = 65535


@reports_errors(NAME)
def watch(arguments: Sequence[str]) -> int:
    """Serve the page until Ctrl-C."""
    parser = CommandParser(NAME, description=ABOUT)
    about = "a run, an evaluation or a sweep, which need not exist yet"
    parser.add_argument("folders", nargs="+", metavar="FOLDER", help=about)
    about = "port of the page (default: 0, any free port)"
    parser.add_argument("--port", type=int, default=0, metavar="N", help=about)
    options = parser.parse(arguments)
    if not 0 <= options.port <= LAST_PORT:
        raise InputError(
            f"--port: must be from 0 (any free port) to {LAST_PORT}, not {options.port}; choose "
            f"another port, or leave --port out"
        )
    _serve([expand_home(folder) for folder in options.folders], options.port)


def _serve(paths: Sequence[Path], port: int) -> NoReturn:
    # These modules import the figures, which is slow.
    from evoros.plugins.watch.folders import Folders
    from evoros.plugins.watch.server import open_server
    from evoros.plugins.watch.watcher import Watcher

    watcher = Watcher(Folders(paths))
    watcher.folders.check()
    server = open_server(port, token_urlsafe(32), watcher.give)
    os.nice(10)  # gives runs precedence
    signal.signal(signal.SIGTERM, _terminate)
    watcher.look()
    Thread(target=server.serve_forever, daemon=True).start()
    print_result(server.address)
    print_result("Open this address in a browser on this machine; press Ctrl-C to stop.")
    try:
        watcher.run()
    finally:
        server.shutdown()
        server.server_close()
        watcher.close()


def _terminate(*_: object) -> NoReturn:
    """Stop as on Ctrl-C, so that no process is left running."""
    raise EvorosError("terminated by a signal")
