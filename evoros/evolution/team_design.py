"""Completes given designs by those of robots that leave nothing to evolve."""

from dataclasses import replace

import numpy as np

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment


def complete_design(experiment: Experiment, design: Design) -> Design:
    """Add the configured design of each other robot that has one of its own and lacks it.

    Raises:
        InputError: such a design leaves something to evolve, so that the configuration does not
            determine it.
    """
    known, agents = design.agents, dict(design.agents)
    for name, agent in experiment.agents.items():
        if agent.design is not None and name not in known:
            configured = find_configured(experiment, name)
            if configured is None:
                raise InputError(
                    f"agents.{name}.design: must leave nothing to evolve (number 0, no genes) for "
                    f"a design that has none for this robot; set agents.{name}.design.number=0, or "
                    f"give a file with rows of the agent {name}"
                )
            agents[name] = configured
    return replace(design, agents=agents)


def find_configured(experiment: Experiment, name: str) -> Design | None:
    """Return the design of another robot that its configuration alone determines, if any."""
    space = experiment.members[name].own_space
    return None if space.size else space.decode(np.empty(0))
