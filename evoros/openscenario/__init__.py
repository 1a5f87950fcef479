"""Scenario files of OpenSCENARIO DSL, which the tool scenario_execution runs; optional."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from evoros.openscenario.simulation import Simulation

__all__ = ["Simulation"]


def __getattr__(name: str) -> type["Simulation"]:
    """Import the simulation on first use: the tool loads this package for its actions, too."""
    if name != "Simulation":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from evoros.openscenario.simulation import Simulation

    return Simulation
