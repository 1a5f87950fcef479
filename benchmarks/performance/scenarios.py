"""Measures how much faster than real time scenario_execution drives missions in the plane.

A scenario waits for the end of a mission of 540 s, of six sonars in the maze, with records on disk
and at several steps of the scenario. ``empty`` is the tool with a simulation that does nothing. The
processor's time counts, so that a busy machine matters less, and of some repetitions the best;
reading the scenario file and building the mission are not included:

    python benchmarks/performance/scenarios.py [repetitions]
"""

import sys
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

from scenario_execution.scenario_execution_base import ScenarioExecution
from scenario_execution.simulation import SimulationInterface

from evoros.plugins.openscenario import Simulation

LIMIT_S, STEPS_S = 540.0, (0.5, 0.2, 0.1)
DESIGN = """design,sensor,x_m,y_m,yaw_deg
six,0,0.24,0.1,20
six,1,0.24,-0.1,-20
six,2,0.2,0.13,50
six,3,0.2,-0.13,-50
six,4,0.1,0.13,80
six,5,0.1,-0.13,-80
"""
SCENARIO = f"""import osc.helpers
import osc.evoros

scenario timed:
    overrides: string = "designs=six.csv world=maze course.time_limit_s={LIMIT_S:g}"
    do serial:
        wait elapsed(1s)
        inject_fault(sensors: "0")
        WAIT
"""
TIMED = SCENARIO.replace("WAIT", 'wait_for_end(ended: "time_limit")')
EMPTY = SCENARIO.replace('inject_fault(sensors: "0")', "wait elapsed(1s)").replace(
    "WAIT", f"wait elapsed({LIMIT_S - 2:g}s)"
)


class Empty(SimulationInterface):  # type: ignore[misc]
    """A simulation that does nothing."""

    dt = 0.1

    def step(self) -> None:
        """Do nothing."""


def time(simulation: SimulationInterface, scenario: str) -> float:
    """Return the processor time of a scenario [s]; it must pass."""
    Path("timed.osc").write_text(scenario)
    tool = ScenarioExecution(
        *(False, False, False, "timed.osc", "records"), register_signal=False, simulation=simulation
    )
    with redirect_stdout(StringIO()):
        tool.parse()
        start = process_time()
        tool.run()
        end = process_time()
        passed = tool.process_results()
    if not passed:
        raise SystemExit("the scenario must pass")
    return end - start


def measure(base: type[SimulationInterface], step: float, scenario: str, repeats: int) -> float:
    """Return the best of some times [s], after one that builds and compiles."""
    simulation = type(base.__name__, (base,), {"dt": step})
    return min([time(simulation(), scenario) for _ in range(repeats + 1)][1:])


def main() -> None:
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    print("simulation | step [s] | processor [s] | times real time")
    with TemporaryDirectory() as folder, chdir(folder):
        Path("six.csv").write_text(DESIGN)
        for step in STEPS_S:
            for base, scenario in ((Empty, EMPTY), (Simulation, TIMED)):
                spent = measure(base, step, scenario, repeats)
                name = base.__name__.lower()
                print(f"{name} | {step:g} | {spent:.3f} | {LIMIT_S / spent:,.0f}", flush=True)


if __name__ == "__main__":
    main()
