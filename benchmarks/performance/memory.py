"""Measures how much memory a long run takes for each mission that it has behind it.

Runs designs in one world for half a simulated second each, as many as a random search would need
missions, and prints the memory of the process (its resident set) at the start and the end and how
fast it grows in the second half. Then it resumes the finished run:

    python benchmarks/performance/memory.py [MISSIONS [OVERRIDE ...]]
"""

import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import evoros
from evoros.evolution.journal import Generation
from evoros.session.status import NoDisplay

MISSIONS = 36_000
POPULATION = 120
SHORT = [
    "world=maze",
    "simulator=planar",
    "course.time_limit_s=0.5",
    "optimizer.validation_trials=0",
    "executor=serial",
    "figures=[]",
    "record=none",
]


def resident_kib() -> float:
    """Return the memory of this process that is in use."""
    status = Path("/proc/self/status").read_text()
    return float(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1])


@dataclass
class MemoryDisplay(NoDisplay):
    """Notes the memory after each generation."""

    samples: list[float] = field(default_factory=list)
    missions: list[int] = field(default_factory=list)  # so far, at each sample
    needed: int = 0

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Count the missions that are needed next."""
        self.needed += missions

    def generation(self, generation: Generation) -> None:
        """Note the memory."""
        self.samples.append(resident_kib())
        self.missions.append(self.needed)


def main() -> None:
    """Measure one run and its resumption."""
    generations = int(sys.argv[1] if len(sys.argv) > 1 else MISSIONS) // POPULATION
    size = [f"optimizer.population_size={POPULATION}", f"optimizer.generations={generations}"]
    with tempfile.TemporaryDirectory() as folder:
        for step in ("run", "resume"):
            display = MemoryDisplay()
            if step == "run":
                evoros.run([*SHORT, *size, *sys.argv[2:]], Path(folder) / "run", display=display)
            else:
                evoros.resume(Path(folder) / "run", display=display)
            missions = display.missions
            half = slice(generations // 2, None)
            slope = np.polyfit(missions[half], display.samples[half], 1)[0]
            print(
                f"{step}: {display.samples[0] / 1024:.1f} MiB after {missions[0]} missions, "
                f"{display.samples[-1] / 1024:.1f} MiB after {missions[-1]}; "
                f"second half {1024 * slope:.0f} bytes a mission"
            )


if __name__ == "__main__":
    main()
