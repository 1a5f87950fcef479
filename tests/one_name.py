"""A program that requires one name of each module, and a user's own modules beside them.

Its argument is the folder of ``write_own_modules``.
"""

import importlib
import pickle
import sys

import evoros
from evoros.analysis import command, subcommands
from evoros.config.compose import add_config_dir
from evoros.executor.processes import Processes


def is_module(name: str) -> bool:
    """Whether something can be imported by this name."""
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True


def main() -> None:
    """Check the names, here and in a worker, and print where evoros is."""
    assert vars(command)["Product"] is subcommands.Product
    assert pickle.loads(pickle.dumps(subcommands.Product)) is subcommands.Product
    assert subcommands.Product.__module__ == "evoros.analysis.subcommands"
    for name in ("analysis", "evoros.evoros", "evoros.tests", "evoros.docs", "evoros.benchmarks"):
        assert not is_module(name), name
    add_config_dir(sys.argv[1])
    with Processes(1).open() as pool:
        assert pool.submit(type, subcommands.Product()).result() is subcommands.Product
        for name in ("analysis", "tests", "docs", "conf"):
            module = importlib.import_module(name)
            place = pool.submit(module.locate).result()
            assert place == module.__file__, (place, module.__file__)
            assert place.startswith(sys.argv[1]), place
    print(evoros.__file__)


if __name__ == "__main__":  # the spawned workers import a script
    main()
