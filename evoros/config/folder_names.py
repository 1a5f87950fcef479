"""Names of run folders, made from the overrides of a job."""

import hashlib
import re
from collections.abc import Sequence

MAX_LENGTH = 100  # characters; file systems allow 255 bytes


def job_name(overrides: Sequence[str]) -> str:
    """Make a readable name for a folder: ``failure=random seed=0`` -> failure-random_seed-0.

    A key is represented by its last part. The name has letters, digits, ``-``, ``_`` and ``.``
    only; it is ``baseline`` without overrides. A longer name is cut and ends in a hash of the
    whole.
    """
    parts = [_part(override) for override in overrides]
    name = "_".join(part for part in parts if part)
    if len(name) > MAX_LENGTH:
        name = f"{name[:MAX_LENGTH]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
    return name or "baseline"


def _part(override: str) -> str:
    key, _, value = override.partition("=")
    key = re.split(r"[./]", key.lstrip("+~").split("@")[0])[-1]
    value = re.sub(r"[^A-Za-z0-9._+-]+", "-", value).strip("-.")
    key = re.sub(r"[^A-Za-z0-9._]+", "-", key).strip("-.")
    return f"{key}-{value}" if value else key
