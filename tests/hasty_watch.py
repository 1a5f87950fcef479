"""The page of running runs, drawn without rest; a process of its own runs it."""

import sys

from evoros.watch import watcher
from evoros.watch.serving import serve

watcher.SHARE = 1.0
watcher.LOOK_S = 0.5


def main() -> None:
    sys.exit(serve(sys.argv[1:]))
