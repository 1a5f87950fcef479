"""Standard streams that cannot be written, as on a full disk or into a pipe without a reader."""

import os
import sys
from contextlib import suppress
from typing import TextIO


def silence(stream: TextIO) -> None:
    """Direct a stream to the null device, here and in processes that start later.

    What it could not write stays in its buffer. Each later flush would fail for that, and with it
    each start of a worker, which flushes the streams.
    """
    with suppress(OSError, ValueError):  # a stream without a file
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


def silence_unwritable() -> None:
    """Silence each standard stream that cannot be written."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            silence(stream)
        except ValueError:  # closed
            pass
