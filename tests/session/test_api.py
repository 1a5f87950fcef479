import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import USER_PARTS, content, finished_run

import evoros
from evoros import api
from evoros.base.arrays import Array


@pytest.fixture(scope="module")
def tiny_config() -> object:
    return evoros.compose(["experiment=tiny", "executor=serial"], config_dir=USER_PARTS)


@pytest.mark.slow
def test_run_is_the_command(tiny_config: object, tmp_path: Path) -> None:
    run = evoros.run(tiny_config, tmp_path / "api")  # type: ignore[arg-type]
    assert content(tmp_path / "api") == content(finished_run(tmp_path / "command"))
    assert run.status["state"] == "finished"
    assert "generation 2/2" in (tmp_path / "api" / "evoros.log").read_text()
    longer = evoros.resume(run.path, ["optimizer.generations=4"])
    assert longer.generations["generation"].max() == 3
    with pytest.raises(evoros.InputError, match="already contains a run"):
        evoros.run(tiny_config, run.path)  # type: ignore[arg-type]


def test_evaluating_twice_is_the_same_and_another_generation_is_not(tiny_config: object) -> None:
    with evoros.Evaluator(tiny_config) as evaluator:  # type: ignore[arg-type]
        space = evaluator.space
        designs = [space.decode(genome(space.size, value)) for value in (0.2, 0.7)]
        table = evaluator.evaluate(designs)
        assert table.equals(evaluator.evaluate(designs))
        assert list(table["fitness_mean"]) == evaluator.score(designs)
        alone = evaluator.evaluate(designs[1:])
        assert alone["fitness_mean"].item() == table["fitness_mean"][1]
        draws = {tuple(evaluator.missions(designs, g)["draws"]) for g in range(3)}
        assert len(draws) == 3
    assert evoros.evaluate(tiny_config, designs).equals(table)  # type: ignore[arg-type]
    with pytest.raises(evoros.InputError, match="must be open"):
        evaluator.score(designs)


def test_own_parts_need_no_composed_configuration(tiny_config: object, tmp_path: Path) -> None:
    overrides = ["experiment=tiny", "executor=serial"]
    with evoros.Evaluator(overrides, config_dir=USER_PARTS) as evaluator:
        designs = [evaluator.space.decode(genome(evaluator.space.size, 0.2))]
        table = evaluator.evaluate(designs)
    assert evoros.evaluate(tiny_config, designs).equals(table)  # type: ignore[arg-type]
    with pytest.raises(
        evoros.InputError, match=r"^config_dir=.* pass the folder to evoros\.compose$"
    ):
        evoros.run(tiny_config, tmp_path, config_dir=USER_PARTS)  # type: ignore[arg-type]


def genome(size: int, value: float) -> Array:
    return np.full(size, value)


@pytest.mark.slow
def test_the_example_of_the_docstring_runs_as_written(tmp_path: Path) -> None:
    """Only the world is made short; worker processes import the script."""
    assert api.__doc__ is not None
    lines = api.__doc__.split("    import cma\n")[1].splitlines()
    script = "import cma\n" + "\n".join(line.removeprefix("    ") for line in lines)
    short = '"trials=2", "world=boxes", "world.boxes.course.time_limit_s=1", "executor.workers=1"'
    script, count = re.subn(r'"trials=2"', short, script)
    assert count == 1
    (tmp_path / "example.py").write_text(script.replace("range(10)", "range(2)"))
    done = subprocess.run(
        [sys.executable, "example.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    printed = [line for line in done.stdout.splitlines() if re.fullmatch(r"\d+ [\d.]+", line)]
    assert [line.split()[0] for line in printed] == ["0", "1"]


def test_importing_evoros_imports_none_of_its_rooms() -> None:
    code = "import evoros, sys; print(*{name.split('.')[0] for name in sys.modules} - KNOWN)"
    known = "import sys; KNOWN = {*sys.stdlib_module_names, *sys.modules}"
    command = [sys.executable, "-c", f"{known}; {code}"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["evoros"]
    code = "import evoros, sys; print(*(name for name in sys.modules if 'evoros' in name))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == {"evoros", "evoros.base", "evoros.base.lazy"}


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(evoros.InputError, match="not a complete run folder"):
        evoros.load_run(tmp_path)
