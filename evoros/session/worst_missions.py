"""The worst missions of what an evaluation does not meet, whose trajectories it keeps."""

from collections.abc import Sequence
from dataclasses import replace

from evoros.base.arrays import Array
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import NONE, Experiment
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import NOT_RUN, Outcomes, judge
from evoros.mission.scenario import Scenario
from evoros.requirement.verdict import MET
from evoros.session.design_tables import NamedDesign
from evoros.session.evaluation_record import EvaluationRecord
from evoros.session.recorded_rows import Row, plan_row, read_rows
from evoros.storage.tables import are_recorded, read_outcomes
from evoros.storage.verdicts import name_worst, read_verdicts
from evoros.terminal.log import LOGGER

Missing = dict[MissionKey, tuple[Mission, Outcomes]]
"""Missions whose trajectory is not kept, with their recorded outcomes."""


def keep_worst(
    record: EvaluationRecord,
    experiment: Experiment,
    designs: Sequence[NamedDesign],
    dispatcher: Dispatcher,
) -> None:
    """Keep the trajectory of the worst mission for each requirement that is not met.

    Missions whose trajectory is not there are run again. Those that end otherwise, as they may with
    a program that draws on clocks, have none.
    """
    if experiment.record == NONE:
        return
    agents = list(experiment.agents)
    missing: dict[bool, Missing] = {}
    scenarios: dict[bool, Scenario] = {}
    for row in _list_worst(record):
        mission, scenario = plan_row(experiment, designs, row)
        outcomes = read_outcomes(row, agents)
        if judge(outcomes).ended not in NOT_RUN and not record.trajectories.has(mission):
            stated = mission.case is not None
            scenarios[stated] = scenario
            missing.setdefault(stated, {})[mission.key] = mission, outcomes
    for stated, missions in missing.items():
        _run_again(record, scenarios[stated], missions, dispatcher, agents)


def _list_worst(record: EvaluationRecord) -> list[Row]:
    """List the rows of the missions that are worst for what is not met."""
    verdicts = [row for row in read_verdicts(record.path) if row["result"] != MET]
    wanted = {tuple(name_worst(row).values()) for row in verdicts}
    if not wanted:
        return []
    columns = list(name_worst(verdicts[0]))
    rows = read_rows(record.path)
    return [row for row in rows if tuple(row[name] for name in columns) in wanted]


def _run_again(
    record: EvaluationRecord,
    scenario: Scenario,
    missions: Missing,
    dispatcher: Dispatcher,
    agents: Sequence[str],
) -> None:
    """Run recorded missions again, and keep their trajectories if they end as recorded."""
    tracks: dict[MissionKey, Array] = {}

    def keep(scenario: Scenario, mission: Mission, trajectory: Array) -> None:
        tracks[mission.key] = trajectory

    again = replace(dispatcher, keep_trajectory=keep)
    for results in again.run(scenario, [mission for mission, _ in missions.values()]):
        for mission, outcomes in results:
            if are_recorded(outcomes, missions[mission.key][1], agents):
                record.keep_trajectory(scenario, mission, tracks[mission.key])
            else:
                LOGGER.warning(
                    "%s: trial %d of design %d in %s ends otherwise when it is run again; its "
                    "trajectory is not kept",
                    *(record.path, mission.trial, mission.design_id, mission.world),
                )
