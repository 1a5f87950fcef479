"""The built wheel, installed into an empty environment, works with nothing of the checkout."""

import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest
from helpers import ROOT


def run(command: list[str | Path], folder: Path) -> str:
    """Standard output of the command; no setting of ours reaches it."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL"))}
    done = subprocess.run(
        [str(part) for part in command], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of programs of an environment that has only the wheel and what it requires."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"  # a copy: building must neither use nor leave files in the checkout
    listed = run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], ROOT)
    for name in listed.splitlines():
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    run([sys.executable, "-m", "build", "--wheel", "--outdir", folder, source], folder)
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "venv", with_pip=True)
    programs = folder / "venv" / "bin"
    run([programs / "python", "-m", "pip", "install", "-q", wheel], folder)
    return programs


@pytest.mark.timeout(600)
def test_a_run_from_any_folder_uses_only_the_wheel(installed: Path, tmp_path: Path) -> None:
    said = run(
        [
            installed / "evoros",
            "experiment=quickstart",
            "world=blocks",
            "optimizer.population_size=2",
            "optimizer.generations=1",
            "hydra.run.dir=here",
        ],
        tmp_path,
    )
    assert "best fitness" in said
    assert "here/champion" in said
    assert (tmp_path / "here" / "champion" / "trajectory_blocks.csv").is_file()
    assert str(ROOT) not in (tmp_path / "here" / "manifest.json").read_text()


def files(folder: Path) -> set[Path]:
    """Relative paths, without what Python has compiled."""
    found = (path.relative_to(folder) for path in folder.rglob("*.*"))
    return {path for path in found if "__pycache__" not in path.parts}


@pytest.mark.timeout(600)
def test_the_wheel_holds_everything_under_our_own_name(installed: Path, tmp_path: Path) -> None:
    site = run(
        [installed / "python", "-c", "import evoros; print(list(evoros.__path__)[0])"], tmp_path
    )
    package = Path(site.strip())
    for folder in ("conf", "robots", "worlds", "analysis/report/web"):
        assert files(ROOT / folder) == files(package / folder), folder
    assert not any((package.parent / name).exists() for name in ("conf", "robots", "analysis"))
    run([installed / "python", "-c", "import evoros.analysis.figures.fitness"], tmp_path)
