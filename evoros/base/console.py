"""Exit statuses and printed results of every command."""

import os
import sys

DONE, STOPPED, INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit statuses: done; stopped and resumable; unusable input; interrupted."""


def print_result(text: str) -> None:
    """Print to standard output; a reader that has closed the pipe early is no error."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
