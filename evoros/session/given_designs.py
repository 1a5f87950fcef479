"""Reads the designs of an evaluation from CSV files, runs and sweeps."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from evoros.base.errors import InputError, single_line
from evoros.evolution.experiment import Experiment
from evoros.files.resources import expand_home
from evoros.formats.strict_xml import parse, quote
from evoros.robot.model import Robot
from evoros.session.design_tables import (
    DesignName,
    NamedDesign,
    add_genes,
    fit_designs,
    read_drafts,
)
from evoros.storage.champion_files import CHAMPION, ROBOT
from evoros.storage.discovery import folders_below
from evoros.storage.layout import (
    DESIGN_FILE,
    GENE_FILE,
    STATUS,
    advise_finish,
    command_of,
    read_json,
)
from evoros.storage.verification import read_text, verify_folder
from evoros.terminal.log import LOGGER, warn_left_out

GENES_BESIDE = {"design.csv": "genes.csv", DESIGN_FILE: GENE_FILE}
"""The file with the other genes of the designs in a file, as runs and evaluations write both."""


def read_given(sources: Sequence[str], experiment: Experiment) -> list[NamedDesign]:
    """Read the designs of all sources, in order; each fits the robots and parts of ``experiment``.

    A source is a CSV file, the folder of a finished run, which stands for its champion, or of a
    sweep, which stands for the champions of all its finished runs.

    Raises:
        InputError: a source cannot be read, or a design is refused.
    """
    designs: list[NamedDesign] = []
    known: set[Path] = set()
    names: set[DesignName] = set()
    for source in sources:
        for path, named in _read_source(source, experiment):
            if path.resolve() in known:
                raise InputError(f"designs: must name each source once, not {path} again; drop one")
            known.add(path.resolve())
            for one in named:
                if (one.source, one.name) in names:
                    raise InputError(
                        f"designs: must name each design once, and {path} has {quote(one.name)} of "
                        f"{one.source} again; drop one source"
                    )
                names.add((one.source, one.name))
            designs += named
    return designs


def _read_source(source: str, experiment: Experiment) -> Iterator[tuple[Path, list[NamedDesign]]]:
    """Yield the designs of each file or run that a source stands for."""
    path = expand_home(source)
    if not path.exists():
        raise InputError(
            f"{path}: must be a CSV file of designs or the folder of a finished run or a sweep, "
            f"and there is none; correct the path"
        )
    if not path.is_dir():
        yield path, _read_file(single_line(source), path, experiment)
        return
    folders = list(folders_below(path, warn_left_out))
    if folders in ([], [path]):
        yield path, _read_champion(single_line(source), path, experiment)
        return
    runs = [folder for folder in folders if command_of(folder) == "evoros"]
    finished = 0
    for folder in runs:
        name = single_line(str(Path(source, folder.relative_to(path))))
        try:
            champion = _read_champion(name, folder, experiment)
        except InputError as error:
            LOGGER.warning("%s; left out", error)
            continue
        finished += 1
        yield folder, champion
    if not finished:
        raise InputError(
            f"designs={path}: must hold a finished run whose champion can be scored, and none of "
            f"its {len(runs)} is one; finish one, or give another folder"
        )


def _read_file(source: str, path: Path, experiment: Experiment) -> list[NamedDesign]:
    """Read a file of designs, with their other genes if they lie beside it."""
    column = None if path.name == DESIGN_FILE else source
    drafts = read_drafts(path, column, experiment.members)
    genes = path.with_name(GENES_BESIDE.get(path.name, path.name))
    if genes != path and genes.is_file():
        add_genes(drafts, genes, column)
    return fit_designs(drafts, experiment)


def _read_champion(source: str, path: Path, experiment: Experiment) -> list[NamedDesign]:
    """Read the champion of a run, with its other genes."""
    require_finished(path, "designs")
    _compare_robots(path, experiment.robot)
    designs, genes = (path / CHAMPION / name for name in ("design.csv", "genes.csv"))
    drafts = read_drafts(designs, source, experiment.members)
    add_genes(drafts, genes, source)
    champions = fit_designs(drafts, experiment)
    for champion in champions:
        _require_configured(designs, champion, experiment)
    return champions


def _require_configured(path: Path, champion: NamedDesign, experiment: Experiment) -> None:
    """Require the run's design of each other robot whose design its configuration determines."""
    for name, design in champion.design.agents.items():
        if experiment.space.find_configured(name) not in (None, design):
            raise InputError(
                f"agents.{name}.design: must be the design that this robot had in the run, because "
                f"it leaves nothing to evolve, and {path} has another; repeat it, or "
                f"give a file of designs without rows of the agent {name}"
            )


def _compare_robots(path: Path, robot: Robot) -> None:
    """Warn if a run had another robot: an evaluation has a configuration of its own."""
    file = path / CHAMPION / ROBOT
    name = parse(read_text(file).encode(), str(file)).get("name") if file.is_file() else None
    if name is not None and name != robot.name:
        LOGGER.warning(
            "%s: its design was evolved on the robot %s, and is scored on %s; to score it as it "
            "was evolved, type like=%s, which takes over the configuration of the run",
            *(path, name, robot.name, path),
        )


def require_finished(path: Path, key: str) -> None:
    """Require that a folder, which a key names, is that of a finished run with a champion.

    Raises:
        InputError: it is not, or it is damaged.
    """
    if command_of(path) != "evoros" or not (path / STATUS).is_file():
        file = "a CSV file or " if key == "designs" else ""
        owner = "an evaluation's" if (path / DESIGN_FILE).is_file() else "no run's"
        raise InputError(
            f"{key}={path}: must be {file}the folder of a finished run or a sweep, and "
            f"the folder is {owner}; give the folder that evoros printed as run folder"
        )
    verify_folder(path)
    state = read_json(path / STATUS).get("state")
    if state != "finished" or not (path / CHAMPION / "design.csv").is_file():
        problem = "that is missing" if state == "finished" else f"its state is {state}"
        raise InputError(
            f"{key}={path}: must be a finished run with a champion, and {problem}; "
            f"{advise_finish(path)}"
        )
