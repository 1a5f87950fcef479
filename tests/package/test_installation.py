"""Every way to get evoros works: a clone, ``pip install -e .`` and the wheel, with the same names.

No environment gets more than what evoros requires: it is linked from the one that runs the tests,
so that only the build backend is downloaded. All paths have spaces.
"""

import json
import os
import shutil
import subprocess
import sys
import tomllib
import venv
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import Distribution, distribution
from pathlib import Path
from zipfile import ZipFile

import pytest
from helpers import ROOT, USER_PARTS
from own_modules import ONE_NAME, write_own_modules
from packaging.requirements import Requirement

pytestmark = [pytest.mark.timeout(900), pytest.mark.slow]

CHECK = """
import json, sys
import evoros

def main():
    assert all(hasattr(evoros, name) for name in evoros.__all__)
    assert evoros.compose([]).values["seed"] == 0
    overrides = ["experiment=tiny", "executor.workers=2", "optimizer.generations=1"]
    overrides.append("figures=[overlay,fitness,mission]")
    evoros.run(overrides, sys.argv[2], config_dir=sys.argv[1])
    run = evoros.load_run(sys.argv[2])
    figures = sorted(file.name for file in run.path.glob("figures/*.pdf"))
    origin = [run.manifest[key] for key in ("commit", "dirty")]
    print(json.dumps([evoros.__file__, run.status["state"], len(run.missions), figures, origin]))


if __name__ == "__main__":  # the spawned workers import a script
    main()
"""
OWN_TEST = """
import evoros
import evoros.analysis.command


def test_mine():
    assert evoros.compose([]).values["seed"] == 0
    assert evoros.__file__.startswith(%r)
"""
FIGURES = ["fitness.pdf", "mission.pdf", "overlay.pdf"]


def execute(command: list[str | Path], folder: Path, **variables: str) -> str:
    """Run a command and return its standard output; no setting of the tests reaches it."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL"))}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env=environment | variables,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def copy_source(folder: Path) -> Path:
    """A clone as git would make it; changes that are not committed yet are a commit of it."""
    listed = execute(["git", "ls-files", "--cached", "--others", "--exclude-standard"], ROOT)
    for name in listed.splitlines():
        if (ROOT / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name, follow_symlinks=False)
    execute(["git", "init", "-q"], folder)
    execute(["git", "add", "-A"], folder)
    identity = ["-c", "user.name=Nobody", "-c", "user.email=nobody@example.org"]
    dates = dict.fromkeys(("GIT_AUTHOR_DATE", "GIT_COMMITTER_DATE"), "2026-01-01T00:00:00Z")
    execute(["git", *identity, "commit", "-q", "-m", "All"], folder, **dates)  # one commit of all
    return folder


def read_commit(clone: Path) -> str:
    return execute(["git", "rev-parse", "HEAD"], clone).strip()


def add_required(requirements: Iterable[str], known: dict[str, Distribution]) -> None:
    """Add all distributions that are required on this machine, with what these require in turn."""
    for requirement in map(Requirement, requirements):
        if requirement.marker and not requirement.marker.evaluate({"extra": ""}):
            continue
        if requirement.name not in known:
            known[requirement.name] = distribution(requirement.name)
            add_required(known[requirement.name].requires or (), known)


@pytest.fixture(scope="module")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that links to what evoros requires, and to nothing else."""
    folder = tmp_path_factory.mktemp("the libraries")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return link(project["dependencies"], folder)


def link(requirements: Iterable[str], folder: Path) -> Path:
    """Link to what is required, and to nothing else."""
    known: dict[str, Distribution] = {}
    add_required(requirements, known)
    for package in known.values():
        for top in {file.parts[0] for file in package.files or ()} - {"..", "__pycache__"}:
            if not (folder / top).exists():
                (folder / top).symlink_to(Path(str(package.locate_file(top))))
    return folder


@pytest.fixture(scope="module")
def testing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that links to what the tests' own configuration needs of pytest."""
    return link(["pytest", "pytest-timeout"], tmp_path_factory.mktemp("pytest"))


@dataclass(frozen=True)
class Way:
    """One way to get evoros: its Python, and where the package must come from."""

    python: Path
    package: Path
    commit: str  # that it was made from
    root: Path  # of the clone
    search_path: str = ""  # PYTHONPATH outside of the clone

    def execute(self, folder: Path, code: str, *arguments: Path) -> str:
        """Run Python code in a current folder, and return the last line that it prints."""
        variables = {"PYTHONPATH": self.search_path} if self.search_path else {}
        return execute([self.python, "-c", code, *arguments], folder, **variables).splitlines()[-1]


def make_environment(folder: Path, libraries: Path) -> Path:
    """An environment without pip and evoros; returns its Python."""
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "libraries.pth").write_text(f"{libraries}\n")
    return folder / "bin" / "python"


def install(python: Path, *what: str | Path) -> Path:
    """Install evoros without what it requires; returns where the package was put."""
    pip: list[str | Path] = [sys.executable, "-m", "pip", "--python", python, "install", "-q"]
    execute([*pip, "--no-deps", *what], python.parent)
    return Path(
        execute([python, "-c", "import evoros; print(evoros.__path__[0])"], python.parent).strip()
    )


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_source(tmp_path_factory.mktemp("a clone") / "of evoros")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory, clone: Path) -> Path:
    """The wheel that is built from the source distribution, which is deleted."""
    folder = tmp_path_factory.mktemp("a build")
    execute([sys.executable, "-m", "build", "--outdir", folder, clone], folder)
    left = execute(["git", "status", "--porcelain", "--ignored"], clone).splitlines()
    assert [name for name in left if "__pycache__" not in name] == []
    (sdist,) = folder.glob("*.tar.gz")
    sdist.unlink()
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module", params=["clone", "editable", "wheel"])
def way(
    request: pytest.FixtureRequest,
    clone: Path,
    libraries: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> Way:
    python = make_environment(tmp_path_factory.mktemp(f"an environment {request.param}"), libraries)
    commit = read_commit(clone)
    if request.param == "clone":
        return Way(python, clone / "evoros", commit, clone, str(clone))
    what: list[str | Path] = ["-e", clone]
    if request.param == "wheel":
        what = [request.getfixturevalue("wheel")]
    return Way(python, install(python, *what), commit, clone)


def test_the_interface_works_from_elsewhere(way: Way, tmp_path: Path) -> None:
    elsewhere = tmp_path / "some where"
    elsewhere.mkdir()
    printed = way.execute(elsewhere, CHECK, USER_PARTS, tmp_path / "a run")
    place, state, missions, figures, origin = json.loads(printed)
    assert (state, figures) == ("finished", FIGURES)
    assert missions > 0
    assert origin == [way.commit, False]
    assert Path(place).parent == way.package
    manifest = json.loads((tmp_path / "a run" / "manifest.json").read_text())
    assert manifest.pop("config_dir") == str(USER_PARTS)  # the user's own, and no other folder
    assert str(ROOT) not in json.dumps(manifest)


def test_each_module_has_one_name_and_hides_none_of_a_users(way: Way, tmp_path: Path) -> None:
    """Python finds the clone's own package in its root, as in notebooks, which are saved there."""
    mine = write_own_modules(tmp_path / "of my own")
    script = way.root / "a_study.py"
    script.write_text(ONE_NAME)
    try:
        in_root = execute([way.python, script, mine], tmp_path)
    finally:
        script.unlink()
    assert Path(in_root.strip()).parent == way.root / "evoros"
    assert Path(way.execute(way.root, ONE_NAME, mine)).parent == way.root / "evoros"
    assert Path(way.execute(tmp_path, ONE_NAME, mine)).parent == way.package


def test_pytest_works_in_the_root_of_the_clone(way: Way, testing: Path, tmp_path: Path) -> None:
    """By ``pytest``, which finds what is installed, and ``python -m pytest``, which the clone."""
    if way.search_path:
        pytest.skip("nothing is installed")
    for option, package in ((["-P"], way.package), ([], way.root / "evoros")):
        file = way.root / "test_mine.py"
        file.write_text(OWN_TEST % str(package))
        command: list[str | Path] = [
            way.python,
            *option,
            "-m",
            "pytest",
            "-p",
            "no:cacheprovider",
            file,
        ]
        try:
            execute(command, way.root, PYTHONPATH=str(testing))
        finally:
            file.unlink()


def test_the_commands_work_everywhere(way: Way, tmp_path: Path) -> None:
    if way.search_path:
        pytest.skip("nothing is installed")
    printed = execute([way.python.with_name("evoros"), "--cfg", "job"], tmp_path)
    assert "_target_: evoros.evolution.experiment.Experiment" in printed
    assert "report" in execute([way.python.with_name("evoros-analyze"), "--help"], way.root)
    for folder in (tmp_path, way.root):  # Python finds modules of the current folder first
        assert way.commit[:10] in execute([way.python, "-m", "evoros", "--version"], folder)


def test_the_wheel_has_everything_once_and_nothing_else(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if ".dist-info/" not in name]
    assert len(names) == len(set(names))
    assert {name.partition("/")[0] for name in names} == {"evoros"}
    for folder in ("analysis", "conf", "robots", "worlds"):
        packed = {name for name in names if name.startswith(f"evoros/{folder}/")}
        assert packed == {f"evoros/{folder}/{file}" for file in files(ROOT / folder)}, folder


def test_the_wheel_of_the_source_distribution_is_that_of_the_clone(
    wheel: Path, clone: Path, tmp_path: Path
) -> None:
    execute([sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", tmp_path, clone], clone)
    (direct,) = tmp_path.glob("*.whl")
    assert contents(direct) == contents(wheel)


def contents(wheel: Path) -> dict[str, bytes]:
    """The files of the package; the list of all files is in the order of the build."""
    with ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if ".dist-info/" not in name]
        return {name: archive.read(name) for name in names}


def files(folder: Path) -> set[Path]:
    """Relative paths, without what Python has compiled."""
    paths = (path.relative_to(folder) for path in folder.rglob("*.*") if path.is_file())
    return {path for path in paths if "__pycache__" not in path.parts}
