"""Checks all jobs of a sweep before the first job starts, and warns about too few seeds."""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import comb
from pathlib import Path
from typing import TypeAlias

from evoros.analysis.run_figures import check_figures
from evoros.base.checks import SEED
from evoros.base.errors import InputError, write_count
from evoros.cli.reporting import JobResult
from evoros.config.configuration import Configuration, check_classes
from evoros.config.jobs import Job, Jobs, RefusedJob
from evoros.evolution.experiment import Experiment
from evoros.session.run import SEARCH, check_run, require_same
from evoros.storage.creation import require_unused
from evoros.storage.layout import MISSIONS
from evoros.terminal.activity import announce
from evoros.terminal.console import INPUT, report_error
from evoros.terminal.log import LOGGER, withhold_messages

Explain: TypeAlias = Callable[[Path, BaseException], JobResult]  # result of a job that raised this
MAX_FAULTS = 10  # maximum number of faults described; further faults are only counted
MAX_BUILT = 16  # maximum number of experiments cached for similar jobs
_BLOCK = re.compile(r"(?m)^(?=[^\s#-])")  # start of a top-level YAML key


def check_jobs(command: str, jobs: Jobs, explain: Explain) -> list[Job]:
    """Check all jobs of a sweep, and report faults; return the jobs, or none if any has a fault."""
    ready, refused = _sort_jobs(jobs, explain)
    faults = list(describe_faults([job.overrides for job in ready], refused))
    if len(faults) > MAX_FAULTS:
        faults[MAX_FAULTS:] = [
            f"{write_count(len(faults) - MAX_FAULTS, 'more error')}; correct the errors above first"
        ]
    for fault in faults:
        report_error(command, fault, INPUT)
    return [] if faults else ready


def _sort_jobs(jobs: Jobs, explain: Explain) -> tuple[list[Job], list[RefusedJob]]:
    ready: list[Job] = []
    refused: list[RefusedJob] = []
    checks = _Checks(explain)
    with withhold_messages():
        named: list[Job] = []
        for job in jobs:  # check class names first, because building a job may take a minute
            if isinstance(job, RefusedJob):
                refused.append(job)
            elif fault := checks.find_misnamed(job):
                refused.append(RefusedJob(job.overrides, fault))
            else:
                named.append(job)
        if refused:
            return named, refused
        for number, job in enumerate(named, 1):
            with announce(f"checking job {number} of {len(jobs)}"):
                fault = checks.find_fault(job)
            if fault:
                refused.append(RefusedJob(job.overrides, fault))
            else:
                ready.append(job)
    return ready, refused


@dataclass
class _Checks:
    explain: Explain
    faults: dict[str, str] = field(default_factory=dict)  # keyed by all values except the seed
    built: dict[str, Experiment] = field(default_factory=dict)  # keyed by all values outside SEARCH

    def find_misnamed(self, job: Job) -> str:
        try:
            if not (job.folder / MISSIONS).exists():
                check_classes(job.config.values, job.config.choices)
        except InputError as error:
            return str(error)
        return ""

    def find_fault(self, job: Job) -> str:
        try:
            if (job.folder / MISSIONS).exists():
                require_same(job.folder, job.config)
                return ""
            require_unused(job.folder)
        except Exception as error:
            return self.explain(job.folder, error).message
        # An invalid seed is a fault; all valid seeds are equivalent.
        seed = job.config.values.get("seed")
        valid = isinstance(seed, int) and SEED.holds(seed) and seed <= SEED.limit
        key = _describe(job.config, ("seed",) if valid else ())
        if key not in self.faults:
            self.faults[key] = self._check(job)
        return self.faults[key]

    def _check(self, job: Job) -> str:
        key = _describe(job.config, SEARCH)
        try:
            check_figures(job.config.values)
            experiment = check_run(job.config, self.built.get(key))
        except Exception as error:  # a user's part may raise any exception
            return self.explain(job.folder, error).message
        if not job.config.evaluates:
            if len(self.built) >= MAX_BUILT:
                self.built.clear()
            self.built.setdefault(key, experiment)
        return ""


def _describe(config: Configuration, ignored: Sequence[str]) -> str:
    values = {key: value for key, value in config.values.items() if key not in ignored}
    return json.dumps([values, config.designs, config.like], sort_keys=True, default=str)


def describe_faults(
    ready: Sequence[tuple[str, ...]], refused: Sequence[RefusedJob]
) -> Iterator[str]:
    """Describe each fault once, after the overrides that all jobs with this fault share."""
    total = len(ready) + len(refused)
    everywhere = set.intersection(*map(set, (*ready, *(job.overrides for job in refused))))
    faults: dict[str, list[tuple[str, ...]]] = {}
    for job in refused:
        faults.setdefault(job.fault, []).append(job.overrides)
    for message, jobs in faults.items():
        common = set.intersection(*map(set, jobs)) - everywhere
        named = " ".join(text for text in jobs[0] if text in common)
        count = f"{len(jobs)} of {total} jobs; no job was started"
        yield f"{named} ({count}): {message}" if named else f"{count}: {message}"


def warn_of_few_seeds(jobs: Iterable[Job]) -> None:
    """Warn if p-values of ``compare`` or ``factors`` cannot be significant with so few seeds."""
    seeds = defaultdict[str, set[int]](set)
    for job in jobs:
        if not job.config.evaluates:
            seeds[find_treatment(job.config)].add(job.config.values["seed"])
    if len(seeds) > 1:
        for advice in advise_seeds(list(seeds.values())):
            LOGGER.warning("%s", advice)


def find_treatment(config: Configuration) -> str:
    """Return the part of the configuration text that all runs of a treatment share."""
    from evoros.analysis.tables.factors import IGNORED

    apart = tuple(f"{key}:" for key in IGNORED if key != "treatment")  # it tells treatments apart
    return "".join(block for block in _BLOCK.split(config.text) if not block.startswith(apart))


def advise_seeds(seeds: list[set[int]]) -> Iterator[str]:
    """Yield a warning, with the number of seeds required, for each test that cannot be significant.

    Holm's correction multiplies the smallest p-value by the number of pairs. ``factors`` tests
    three or more treatments; with two runs each of three treatments, 6 of 90 permutations are as
    extreme as the data.
    """
    from evoros.analysis.statistics.small_samples import LEVEL
    from evoros.analysis.statistics.two_samples import minimum_p, minimum_replicates

    pairs, counts = comb(len(seeds), 2), sorted(map(len, seeds))
    first, second, begin = counts[-1], counts[-2], min(map(min, seeds))

    def advise(test: str, why: str, needed: int) -> str:
        ends = f"{begin},{begin + needed}" if begin else f"{needed}"
        return f"{test}, because {why}; for {needed} seeds per treatment, type 'seed=range({ends})'"

    known = f"{first}" if first == counts[0] else f"{counts[0]} to {first}"
    head = f"{len(seeds)} treatments with {known} seed{'s' * (known != '1')} each: 'evoros analyze"
    smallest = min(1.0, pairs * minimum_p(first, second))
    if smallest >= LEVEL:
        after = f" after correction for {pairs} comparisons" if pairs > 1 else ""
        why = f"its smallest possible p-value is {smallest:.2g}{after}"
        yield advise(f"{head} compare' cannot detect a difference", why, minimum_replicates(pairs))
    pairs_of_three = len(counts) == 3 and first < 3
    if len(counts) > 2 and (counts[0] < 2 or pairs_of_three):
        why = (
            "its smallest possible p-value is 0.067"
            if counts[0] > 1
            else "the spread of a treatment cannot be estimated from one run"
        )
        yield advise(f"{head} factors' cannot detect an effect", why, 3 if len(counts) == 3 else 2)
