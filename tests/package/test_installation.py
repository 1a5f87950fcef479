"""An installation from a clone works everywhere, with the same names and the wheel's files.

The environment has only what evoros requires: it is linked from the one that runs the tests, so
that only the build backend is downloaded. All paths have spaces. That an editable installation
works is shown by all other tests.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
from collections.abc import Iterable
from importlib.metadata import Distribution, distribution
from pathlib import Path
from runpy import run_path
from types import SimpleNamespace
from typing import NamedTuple
from zipfile import ZipFile

import pytest
from helpers import ROOT, USER_PARTS
from own_modules import ONE_NAME, write_own_modules
from packaging.requirements import Requirement

from evoros.compilation.machine_code import BUNDLED

pytestmark = [pytest.mark.timeout(1800), pytest.mark.slow]

CHECK = """
import json, sys
import evoros

def main():
    assert all(hasattr(evoros, name) for name in evoros.__all__)
    assert evoros.compose([]).values["seed"] == 0
    overrides = ["experiment=tiny", "executor.workers=1", "optimizer.generations=1"]
    overrides.append("figures=[overlay]")
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


class Installed(NamedTuple):
    """The Python of an environment with evoros, and the clone of its commit."""

    python: Path
    package: Path
    clone: Path
    commit: str


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


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory, clone: Path, libraries: Path) -> Installed:
    """Evoros as the pipelines of docs/examples install it, in an environment without pip."""
    folder = tmp_path_factory.mktemp("an environment")
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "libraries.pth").write_text(f"{libraries}\n")
    python = folder / "bin" / "python"
    commit = execute(["git", "rev-parse", "HEAD"], clone).strip()
    pip: list[str | Path] = [sys.executable, "-m", "pip", "--python", python, "install", "-q"]
    execute([*pip, "--no-compile", f"git+{clone.as_uri()}@{commit}"], folder)
    return Installed(python, site / "evoros", clone, commit)


def test_the_interface_works_from_elsewhere(installed: Installed, tmp_path: Path) -> None:
    elsewhere = tmp_path / "some where"
    elsewhere.mkdir()
    printed = execute([installed.python, "-c", CHECK, USER_PARTS, tmp_path / "a run"], elsewhere)
    place, state, missions, figures, origin = json.loads(printed.splitlines()[-1])
    assert (state, figures) == ("finished", ["overlay.pdf"])
    assert missions > 0
    assert origin == [installed.commit, False]
    assert Path(place).parent == installed.package
    manifest = json.loads((tmp_path / "a run" / "manifest.json").read_text())
    assert manifest.pop("config_dir") == str(USER_PARTS)  # the user's own, and no other folder
    assert str(ROOT) not in json.dumps(manifest)


def test_each_module_has_one_name_and_hides_none_of_a_users(
    installed: Installed, tmp_path: Path
) -> None:
    """Python finds the clone's own package in its root, as in notebooks, which are saved there."""
    mine = write_own_modules(tmp_path / "of my own")
    for folder, package in (
        (tmp_path, installed.package),
        (installed.clone, installed.clone / "evoros"),
    ):
        script = folder / "a_study.py"
        script.write_text(ONE_NAME)
        try:
            printed = execute([installed.python, script, mine], tmp_path)
        finally:
            script.unlink()
        assert Path(printed.strip()).parent == package


def test_pytest_works_in_the_root_of_the_clone(
    installed: Installed, testing: Path, tmp_path: Path
) -> None:
    """By ``pytest``, which finds what is installed, and ``python -m pytest``, which the clone."""
    for option, package in ((["-P"], installed.package), ([], installed.clone / "evoros")):
        file = installed.clone / "test_mine.py"
        file.write_text(OWN_TEST % str(package))
        words = [*option, "-m", "pytest", "-p", "no:cacheprovider", str(file)]
        try:
            execute([installed.python, *words], installed.clone, PYTHONPATH=str(testing))
        finally:
            file.unlink()


def test_the_commands_work_everywhere(installed: Installed, tmp_path: Path) -> None:
    python, clone = installed.python, installed.clone
    printed = execute([python.with_name("evoros"), "--cfg", "job"], tmp_path)
    assert "_target_: evoros.evolution.experiment.Experiment" in printed
    assert "report" in execute([python.with_name("evoros-analyze"), "--help"], clone)
    # Python finds modules of the current folder first.
    assert installed.commit[:10] in execute([python, "-m", "evoros", "--version"], clone)


def test_the_wheel_has_everything_once_and_nothing_else(wheel: Path, installed: Installed) -> None:
    """The wheel of the source distribution, and the one that pip builds from a clone."""
    names = list(contents(wheel))
    with ZipFile(wheel) as archive:
        assert len(archive.namelist()) == len(set(archive.namelist()))
    assert {name.partition("/")[0] for name in names} == {"evoros"}
    for folder in ("analysis", "conf", "robots", "worlds"):
        packed = {name for name in names if name.startswith(f"evoros/{folder}/")}
        assert packed == {f"evoros/{folder}/{file}" for file in files(ROOT / folder)}, folder
    package = installed.package
    direct = {f"evoros/{file}": (package / file).read_bytes() for file in files(package)}
    assert direct == contents(wheel)


def test_the_first_run_compiles_nothing(installed: Installed, tmp_path: Path) -> None:
    tiny = ["optimizer.population_size=2", "optimizer.generations=1", "figures=[]"]
    words = ["experiment=coevolution", *tiny, f"hydra.run.dir={tmp_path / 'run'}"]
    command = installed.python.with_name("evoros")
    execute([command, *words], tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"))
    compiled, shipped = tmp_path / "cache" / "evoros", installed.package / BUNDLED
    assert {file.relative_to(shipped): file.read_bytes() for file in shipped.rglob("*.nb?")} == {
        file.relative_to(compiled): file.read_bytes() for file in compiled.rglob("*.nb?")
    }


def test_a_build_waits_for_all_shares_even_if_one_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder into which they compile is deleted afterwards."""
    name = "hatchling.builders.hooks.plugin.interface"
    monkeypatch.setitem(sys.modules, name, SimpleNamespace(BuildHookInterface=object))
    hook = run_path(str(ROOT / "hatch_build.py"))["AddMade"]
    waited: list[str] = []

    def start(command: list[str], **_: object) -> SimpleNamespace:
        def wait() -> bool:
            waited.append(command[-2])
            return command[-2] == "0"

        return SimpleNamespace(wait=wait)

    monkeypatch.setitem(hook._compile.__globals__, "Popen", start)
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    assert hook._compile(SimpleNamespace(root=str(ROOT)), tmp_path) == {}
    assert waited == ["0", "1", "2"]


def contents(wheel: Path) -> dict[str, bytes]:
    """The files of the package, without machine code, whose bytes differ between builds."""
    with ZipFile(wheel) as archive:
        listed = archive.namelist()
        names = [name for name in listed if not re.search(rf"\.dist-info/|/{BUNDLED}/", name)]
        return {name: archive.read(name) for name in names}


def files(folder: Path) -> set[Path]:
    """Relative paths, without what Python and numba have compiled."""
    paths = (path.relative_to(folder) for path in folder.rglob("*.*") if path.is_file())
    return {path for path in paths if not {"__pycache__", BUNDLED} & {*path.parts}}
