"""The thresholds of redundancy, options of the subcommands ``strategies`` and ``claims``."""

import argparse
from math import inf

from evoros.base.errors import InputError

from ..designs.pairs import NEAR_DEG, NEAR_M


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the thresholds of redundancy."""
    about = f"sensors are redundant up to this distance; {NEAR_M}"
    parser.add_argument("--near-m", type=float, default=NEAR_M, metavar="M", help=about)
    about = f"and up to this difference in direction; {NEAR_DEG}"
    parser.add_argument("--near-deg", type=float, default=NEAR_DEG, metavar="DEG", help=about)


def check_thresholds(options: argparse.Namespace) -> None:
    """Check the thresholds of redundancy."""
    for key, value in (("--near-m", options.near_m), ("--near-deg", options.near_deg)):
        if not 0 <= value < inf:
            raise InputError(f"{key}: must be a number of at least 0, not {value}; correct it")
