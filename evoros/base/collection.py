"""How often Python looks for unused objects that refer to each other."""

import gc

ALLOCATIONS, YOUNGER = 50_000, 20


def collect_rarely() -> None:
    """Look for them rarely: imports and configurations make many objects, and nearly all stay.

    With Python's own 700 allocations, a run takes a twentieth longer to start.
    """
    gc.set_threshold(ALLOCATIONS, YOUNGER, YOUNGER)
