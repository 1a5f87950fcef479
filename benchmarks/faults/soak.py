"""Measures how much memory a long run takes for each mission that it has behind it.

Runs designs in one world for half a simulated second each, at least as many missions as are asked
for, and prints the memory of the process (its resident set) at the start and the end and how
fast it grows in the second half. Then it resumes the finished run.
"""

import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import evoros
from evoros.evolution.journal import Generation
from evoros.session.status import NoDisplay

NEW = 0.45
"""The share of a population that is new in each generation, somewhat below what was measured."""
LIMIT_BYTES = 150
"""The growth for each mission that counts as flat."""
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


def soak(count: int) -> bool:
    """Measure a run of so many missions and its resumption; whether either grows too fast."""
    generations = round(count / POPULATION / NEW)
    size = [f"optimizer.population_size={POPULATION}", f"optimizer.generations={generations}"]
    slopes = []
    with tempfile.TemporaryDirectory() as folder:
        for step in ("run", "resume"):
            display = MemoryDisplay()
            if step == "run":
                evoros.run([*SHORT, *size], Path(folder) / "run", display=display)
            else:
                evoros.resume(Path(folder) / "run", display=display)
            slopes.append(report(step, display))
    return max(slopes) > LIMIT_BYTES


def report(step: str, display: MemoryDisplay) -> float:
    """Print the memory of a step and return its growth in the second half [bytes a mission]."""
    missions, samples = display.missions, display.samples
    half = slice(len(missions) // 2, None)
    slope = 1024 * float(np.polyfit(missions[half], samples[half], 1)[0])
    sizes = [f"{samples[at] / 1024:.1f} MiB after {missions[at]} missions" for at in (0, -1)]
    print(f"{step}: {', '.join(sizes)}; second half {slope:.0f} bytes a mission", flush=True)
    return slope
