"""Serves the page: the program that ``evoros watch`` runs aside, with the same arguments."""

import signal
import sys
from collections.abc import Sequence
from secrets import token_urlsafe
from threading import Thread
from typing import NoReturn

from evoros.base.errors import EvorosError
from evoros.files.resources import expand_home
from evoros.terminal.console import print_result, reports_errors
from evoros.watch.aside import give_way
from evoros.watch.command import NAME, parse

TOKEN_BYTES = 32


@reports_errors(NAME)
def serve(arguments: Sequence[str]) -> int:
    """Serve the page until a signal ends it."""
    # These load what draws figures, which takes long.
    from evoros.watch.folders import Folders
    from evoros.watch.server import open_server
    from evoros.watch.watcher import Watcher

    options = parse(arguments)
    watcher = Watcher(Folders([expand_home(folder) for folder in options.folders]))
    watcher.folders.check()
    server = open_server(options.port, token_urlsafe(TOKEN_BYTES), watcher.give)
    watcher.look()
    Thread(target=server.serve_forever, daemon=True).start()
    print_result(server.address)
    print_result("Open this address in a browser on this machine. Ctrl-C ends the page.")
    try:
        watcher.run()
    finally:
        server.shutdown()
        server.server_close()
        watcher.close()


def _terminate(*_: object) -> NoReturn:
    """End in the same order as Ctrl-C, so that no process is left."""
    raise EvorosError("terminated by a signal")


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, _terminate)
    give_way()
    sys.exit(serve(sys.argv[1:]))
