"""Names of run folders, from the overrides of a job."""

import hashlib
import re
from collections.abc import Sequence

LONGEST = 100  # characters; file systems allow 255 bytes


def job_name(overrides: Sequence[str]) -> str:
    """A readable name, safe as a folder: ``failure=random seed=0`` -> failure-random_seed-0.

    Of a key, its last part. Letters, digits, ``-``, ``_`` and ``.`` only; ``baseline`` where
    nothing is overridden. Longer names are cut and end in a hash of the whole.
    """
    parts = [_part(override) for override in overrides]
    name = "_".join(part for part in parts if part)
    if len(name) > LONGEST:
        name = f"{name[:LONGEST]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
    return name or "baseline"


def _part(override: str) -> str:
    key, _, value = override.partition("=")
    key = re.split(r"[./]", key.lstrip("+~").split("@")[0])[-1]
    value = re.sub(r"[^A-Za-z0-9._+-]+", "-", value).strip("-.")
    key = re.sub(r"[^A-Za-z0-9._]+", "-", key).strip("-.")
    return f"{key}-{value}" if value else key
