"""The command that draws the page of running runs without pauses, run in a separate process."""

from evoros.cli.main import main
from evoros.plugins.watch import watcher

__all__ = ["main"]

watcher.SHARE = 1.0
watcher.LOOK_S = 0.5
