"""Figures, tables, videos and reports from run folders; no code of a run is imported."""

if __name__ != "evoros.analysis":
    raise ImportError(
        f"{__name__}: the folder analysis/ of evoros is imported as evoros.analysis; a package of "
        f"your own of this name needs an __init__.py and a place on the path before that folder"
    )
