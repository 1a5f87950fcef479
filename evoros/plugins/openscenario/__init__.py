"""Missions as simulations of OpenSCENARIO DSL files, which scenario_execution runs."""

from typing import TYPE_CHECKING

from evoros.files.plugins import Plugin

if TYPE_CHECKING:
    from evoros.plugins.openscenario.simulation import Simulation

__all__ = ["PLUGIN", "Simulation"]

PLUGIN = Plugin(__name__, "OpenSCENARIO DSL scenario files", extras=("scenario",))


def __getattr__(name: str) -> type["Simulation"]:
    """Import the simulation lazily, because scenario_execution imports this package without it."""
    if name != "Simulation":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from evoros.plugins.openscenario.simulation import Simulation

    return Simulation


def get_library() -> tuple[str, str]:
    """Return the package and the file name of its library in ``lib_osc``."""
    return "evoros.plugins.openscenario", "evoros.osc"
