"""The console commands; ``python -m evoros`` is the same as ``evoros``."""

import sys
from importlib import import_module

from evoros.base.lazy import collect_rarely


def main() -> None:
    """Run the command ``evoros``."""
    _start("evoros", "evoros.cli.main")


def analyze() -> None:
    """Run the command ``evoros-analyze``."""
    _start("evoros-analyze", "evoros.analysis.command")


def _start(name: str, module: str) -> None:
    """Import and run a command; report Ctrl-C during the import as during the run."""
    try:
        collect_rarely()
        import_module(module).main()
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
