"""Options that several subcommands have."""

import argparse


def add_run(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the run whose champion is shown."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")


def add_worlds(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the worlds."""
    about = "only this world; may be repeated"
    parser.add_argument("--world", metavar="NAME", action="append", help=about)
