"""Arguments of commands."""

from argparse import ArgumentParser
from typing import NoReturn

from evoros.base.errors import InputError


class CommandParser(ArgumentParser):
    """A parser that raises errors of evoros, which commands report in one line."""

    def error(self, message: str) -> NoReturn:
        """Refuse the arguments."""
        raise InputError(f"{message}; see {self.prog} --help")
