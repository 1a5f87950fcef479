"""Tells the tool scenario_execution where the actions of ``import osc.evoros`` are declared."""


def get_library() -> tuple[str, str]:
    """Return the package, and the file in its folder ``lib_osc``."""
    return "evoros.openscenario", "evoros.osc"
