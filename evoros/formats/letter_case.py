"""Finds files whose names differ from the wanted ones in the case of letters alone.

People write such names on systems that do not mind, as ``Barrel.DAE`` for ``barrel.dae``.
"""

import os
from pathlib import Path


def find_in_any_case(path: Path) -> Path | None:
    """Return the only existing path that differs from an absolute one in case alone, or None."""
    here = Path(path.anchor)
    for part in path.parts[1:]:
        if not (here / part).exists():
            try:
                names = [name for name in os.listdir(here) if name.lower() == part.lower()]
            except OSError:
                return None
            if len(names) != 1:
                return None
            part = names[0]
        here /= part
    return here
