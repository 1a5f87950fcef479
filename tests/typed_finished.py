"""Finished runs and commands that provoke the messages which propose something to type.

In a command, ``{tiny}``, ``{small}`` and ``{parts}`` stand for the words of ``WORDS``; in what is
typed afterwards, ``{}`` stands for what the message proposes.
"""

import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from helpers import USER_PARTS
from proposal_sites import has_plugin

from evoros.analysis.command import evoros_analyze
from evoros.api import Evaluator
from evoros.config.compose import compose
from evoros.session.replay import replay_in_plane
from evoros.storage.reading import load_run
from evoros.terminal.console import DONE

QUICK = ("optimizer.generations=1", "optimizer.population_size=2", "optimizer.validation_trials=1")
_PARTS = f"--config-dir {shlex.quote(str(USER_PARTS))} executor=serial"
_SMALL = "simulator=bicycle world=plains figures=[]"
WORDS: Mapping[str, str] = {
    "{parts}": _PARTS,
    "{tiny}": " ".join([_PARTS, "experiment=tiny", *QUICK]),
    "{small}": " ".join([_PARTS, _SMALL, *QUICK]),  # of no experiment
}
CALM = "failure=none ~failure.earliest_s ~failure.latest_s"
SPATIAL = "failure=spatial"
TEAM = "simulator=planar agents=oncoming +design@agents.oncoming.design=six_sonars"
Call = Callable[[Sequence[str]], object]
Step = str | Call
"""A command without its first word ``evoros``, or a call that takes what is proposed.

The output of a call is its result as text, or the message with which it fails.
"""


class Finished(NamedTuple):
    """Runs and a step that provoke a message, and the steps in which its proposal is typed."""

    key: str  # see ``proposal_sites.key_of``
    runs: Mapping[str, str]  # further words of the tiny run in each folder
    asked: Step
    typed: Sequence[Step] = ()  # empty: what was asked, with the proposal in place of its words
    filled: Mapping[str, str] = {}  # words that stand for the user's names
    made: Sequence[str] = ()  # commands typed before; ``cut`` interrupts a run
    quick: bool = False  # one of those that stand for all in the quick tests
    others: Sequence[str] = ()  # keys of messages that propose the same


def _missions_by_folder(_: Sequence[str]) -> object:
    with Evaluator(compose(["executor=serial"])) as evaluator:
        return evaluator.missions("r")  # type: ignore[arg-type]


def _read_trajectory(folder: str) -> Call:
    return lambda _: load_run(folder).trajectory("near")


def _read_mission(folder: str) -> Call:
    return lambda _: load_run(folder).mission_trajectory(0, _find_unkept(folder), "near", 0)


def _find_unkept(folder: str) -> int:
    """Return the design of a first generation that is not its best."""
    return int(load_run(folder).generations.sort_values("fitness")["id"].iloc[0])


def _required_page(folder: str) -> Call:
    def draw(_: Sequence[str]) -> object:
        assert evoros_analyze(["requirements", folder]) == DONE
        text = Path(folder, "figures/requirements.html").read_text(encoding="utf-8")
        return re.sub("<[^<>]*>", "\n", text)

    return draw


def _build_scenario(words: Sequence[str]) -> object:
    from evoros.plugins.openscenario.simulation import build_setting  # imports the other program

    return build_setting(("designs=r", *words), None, 0)


def _replay_in_plane(folder: str) -> Call:
    return lambda _: list(replay_in_plane(load_run(folder), []))


_RUN = {"r": ""}
_TWO = {"r": "", "none": CALM}
_NEW = "hydra.run.dir=new"
_EVALUATE = f"evaluate {{parts}} {{}} trials=1 {_NEW}"
_DELIVERY = {"FOLDER": "r", "...": "delivery"}
_VALIDATED = "evaluate {parts} like=r evaluation_draws=validation"
_TEAM = "evaluate {parts} like=p simulator=planar trials=1"
_SEEDS = "-m {tiny} failure=random,spatial {} hydra.sweep.dir=new"
_PAPER, _CLAIMS = "evoros/plugins/evo_ros_2018/numbered_figures.py", "evoros/plugins/evo_ros_2018"

OF_FIGURES = (
    Finished(
        "analysis/figures/regions.py design=around",
        {"r": "design=views controller.avoidance.range_m=1 simulator=planar"},
        "analyze regions r",
        (f"{{tiny}} {{}} {_NEW}", "analyze regions r new"),
    ),
    Finished(
        "analysis/run_figures.py figures", {}, f"{{tiny}} figures=[nothing] {_NEW}", quick=True
    ),
    Finished(
        "analysis/tables/treatments.py failure=none",
        _TWO,
        "analyze fitness r none --where failure",
        ("analyze fitness r none --where {}",),
        quick=True,
    ),
    Finished(
        "analysis/figures/compare.py like=SWEEP",
        {"r/a": "", "r/b": "seed=1"},
        "analyze compare r",
        (f"evaluate {{parts}} {{}} {_NEW}", "analyze compare r new"),
        {"SWEEP": "r"},
    ),
    Finished(
        "analysis/figures/factors.py seed=range({MIN_VALUES})",
        {"r": "", "spatial": SPATIAL},
        "analyze factors r spatial",
        (_SEEDS, "analyze factors new"),
    ),
    Finished(
        "analysis/statistics/comparison.py seed=range({needed})",
        {"r": "", "spatial": SPATIAL},
        "analyze compare r spatial",
        (_SEEDS, "analyze compare new"),
    ),
    Finished(
        "analysis/figures/mission.py record=all",
        {},
        "analyze mission --help",
        (f"{{tiny}} {{}} optimizer.generations=2 {_NEW}", "cut new", "analyze mission new"),
    ),
    Finished(
        "analysis/figures/worst.py failure=given",
        _RUN,
        "analyze worst ev",
        (f"evaluate {{parts}} like=r {{}} {_NEW}",),
        made=("evaluate {parts} like=r trials=1 hydra.run.dir=ev",),
    ),
    Finished(
        "analysis/report/requirements.py like=FOLDER",
        _RUN,
        "analyze requirements r",
        (_EVALUATE, "analyze requirements new"),
        _DELIVERY,
    ),
    Finished(
        "analysis/report/requirements.py record=none",
        _RUN,
        _required_page("ev"),
        (f"evaluate {{parts}} like=r requirements=delivery trials=1 {_NEW}", _required_page("new")),
        made=(
            "evaluate {parts} like=r requirements=delivery record=none trials=1 hydra.run.dir=ev",
        ),
    ),
    Finished(
        "analysis/figures/controls.py controls=all",
        _RUN,
        "analyze controls r",
        ("resume r {parts} {} controls.trials=1", "analyze controls r"),
        {"RUN": "r"},
    ),
    Finished(
        "analysis/statistics/worst_cases.py like=FOLDER",
        _RUN,
        "analyze worst r",
        (f"evaluate {{parts}} {{}} {_NEW}", "analyze worst new"),
        {"FOLDER": "r", "...": "2"},
    ),
    Finished(
        "analysis/tables/elites.py +measure@{group}.spread=spread",
        _RUN,
        "analyze archive r",
        (f"{{tiny}} {{}} {_NEW}", "analyze archive new"),
    ),
    Finished(
        "analysis/tables/validated.py designs=SWEEP",
        _TWO,
        "analyze compare r ev --under ev",
        (f"evaluate {{parts}} like=none {{}} trials=1 {_NEW}", "analyze compare r new --under new"),
        {"SWEEP": "r"},
        made=("evaluate {parts} like=none trials=1 hydra.run.dir=ev",),
    ),
)

OF_THE_PAPER = (
    Finished(
        f"{_CLAIMS}/claims.py optimizer.generations={{EARLY + 10}}",
        {"r": "", "s": "seed=1"},
        "analyze claims r s",
        ("resume r {parts} {}", "resume s {parts} {}", "analyze claims r s"),
    ),
    Finished(
        f"{_CLAIMS}/claims_designs.py experiment=free_placement",
        _RUN,
        "analyze claims r",
        (f"{{small}} {{}} optimizer.population_size=4 {_NEW}", "analyze claims r new"),
    ),
    Finished(
        f"{_CLAIMS}/claims.py failure={{kind}}",
        {"none": CALM},
        "analyze claims none",
        (f"{{tiny}} {{}} {_NEW}", "analyze claims none new"),
        others=[f"{_CLAIMS}/claims_designs.py failure={kind}" for kind in ("random", "spatial")],
    ),
    Finished(
        f"{_CLAIMS}/course.py record=all",
        {},
        "analyze course --help",
        (f"{{tiny}} {{}} optimizer.generations=2 {_NEW}", "cut new", "analyze course new"),
    ),
    Finished(
        f"{_CLAIMS}/failure.py failure=spatial",
        _RUN,
        "analyze failure r",
        (f"{{tiny}} {{}} {_NEW}", "analyze failure r new"),
    ),
    Finished(
        f"{_PAPER} experiment=case_study",
        {},
        "analyze paper --help",
        ("-m {small} {} seed=0 hydra.sweep.dir=new", "analyze paper new"),
    ),
    Finished(
        f"{_PAPER} failure={{BASELINE}}",
        {"none": CALM, "spatial": SPATIAL},
        "analyze paper none spatial",
        ("resume none {parts}", "analyze paper none spatial"),
        made=("cut none",),
    ),
    Finished(
        f"{_PAPER} failure={{failure}}",
        _RUN,
        "analyze paper r",
        (f"{{small}} {{}} {_NEW}", "analyze paper r new"),
    ),
)

OF_EVALUATIONS = (
    Finished(
        "evoros/api.py designs=FOLDER",
        _RUN,
        _missions_by_folder,
        (f"evaluate {{small}} {{}} {_NEW}",),
        {"FOLDER": "r"},
    ),
    Finished(
        "evoros/config/recorded.py {key}={number}",
        _RUN,
        "resume ev {parts} validation.trials=3",
        (f"{_VALIDATED} {{}} {_NEW}",),
        made=(f"{_VALIDATED} validation.max_trials=2 hydra.run.dir=ev",),
    ),
    Finished(
        "evoros/design/team.py agents.{name}.design.number=0",
        {"p": "simulator=planar"},
        f"{_TEAM} {TEAM.partition(' ')[2]} {_NEW}",
    ),
    Finished(
        "evoros/mission/member.py +design@{self.key}design=...",
        {"p": "simulator=planar", "team": TEAM},
        f"{_TEAM} designs=team agents=oncoming {_NEW}",
        filled={"...": "six_sonars"},
    ),
    Finished(
        "evoros/session/design_tables.py agents=...",
        {"p": "simulator=planar", "team": TEAM},
        f"{_TEAM} designs=team {_NEW}",
        (f"{_TEAM} designs=team {{}} +design@agents.oncoming.design=six_sonars {_NEW}",),
        {"...": "oncoming"},
    ),
    Finished(
        "evoros/session/evaluation.py designs=FILE.csv",
        _RUN,
        f"evaluate {{small}} {_NEW}",
        filled={"FILE.csv": "r/champion/design.csv"},
        quick=True,
    ),
    Finished(
        "evoros/session/evaluation.py evaluation_draws=validation",
        {"r": "optimizer.validation_trials=0"},
        f"{_VALIDATED} {_NEW}",
    ),
    Finished(
        "evoros/session/evaluation.py evaluation_draws=validation",
        _RUN,
        f"{_VALIDATED} worst_cases=search {_NEW}",
        (f"{_VALIDATED} {_NEW}", "evaluate {parts} like=r worst_cases=search worst_cases.most=1"),
    ),
    Finished(
        "evoros/session/given_designs.py {choice}=...",
        {"study/a": "", "study/b": "seed=1"},
        f"evaluate {{parts}} like=study trials=1 {_NEW}",
        filled={"...": "0"},
    ),
    Finished(
        "evoros/session/replay.py {differing[0]}=...",
        _RUN,
        "replay ev",
        ("replay ev {}",),
        {"...": "near"},
        made=("evaluate {parts} like=r trials=1 hydra.run.dir=ev",),
    ),
    Finished(
        "evoros/session/replay.py simulator=planar",
        {"r": ""},
        _replay_in_plane("r"),
        (f"{{tiny}} {{}} {_NEW}", _replay_in_plane("new")),
    ),
    Finished(
        "evoros/session/search.py like=FOLDER",
        _RUN,
        f"{{tiny}} requirements=delivery {_NEW}",
        (_EVALUATE,),
        _DELIVERY,
    ),
    Finished(
        "evoros/session/search.py like=FOLDER",
        _RUN,
        f"{{tiny}} +evaluation_draws=validation {_NEW}",
        (_EVALUATE,),
        {"FOLDER": "r", "...": "validation"},
    ),
    Finished(
        "evoros/storage/reading.py record={fix}",
        {"r": "record=none"},
        _read_trajectory("r"),
        (f"{{tiny}} {{}} {_NEW}", _read_trajectory("new")),
        quick=True,
    ),
    Finished(
        "evoros/storage/reading.py record={fix}",
        {"r": "record=champion"},
        _read_mission("r"),
        (f"{{tiny}} {{}} {_NEW}", _read_mission("new")),
    ),
    Finished(
        "evoros/storage/reading.py record=champions",
        {"r": "record=champions"},
        _read_mission("r"),
        (f"{{tiny}} {{}} {_NEW}", _read_mission("new")),
    ),
    Finished("evoros/plugins/openscenario/simulation.py world=maze", _RUN, _build_scenario),
    Finished(
        "evoros/plugins/leaderboard/rows.py experiment={nearest}",
        {},
        "leaderboard r",
        (f"{{parts}} {{}} {' '.join(QUICK[:2])} figures=[] {_NEW}", "leaderboard new"),
        made=(
            f"{{parts}} experiment=benchmark_network {' '.join(QUICK[:2])} figures=[] "
            "course.time_limit_s=100 hydra.run.dir=r",
        ),
    ),
)

CASES = [case for case in (*OF_FIGURES, *OF_THE_PAPER, *OF_EVALUATIONS) if has_plugin(case.key)]
