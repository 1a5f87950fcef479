"""The public names: each module has one, and authors of parts need one import."""

import ast
import inspect
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest
from documents import DOCS
from helpers import ROOT

import evoros
from evoros import parts

PUBLIC = [
    import_module(name)
    for name in ("evoros", "evoros.parts", "evoros.analysis", "evoros.testing")
    if find_spec(name)
]
LAZY = [module for module in PUBLIC if "_HOMES" in vars(module)]
NAMES = {module.__name__: set(module.__all__) for module in PUBLIC}
NAMES["evoros.plugins.openscenario"] = {"Simulation"}  # which needs an extra
NAMES["evoros.plugins.recordings"] = {"RenderOptions", "film_champion"}
NAMES["evoros.files.plugins"] = {"Plugin", "Subcommand"}  # without all that evoros.parts imports


def test_a_public_name_has_one_home() -> None:
    names = [name for module in PUBLIC for name in module.__all__]
    assert sorted(names) == sorted(set(names))


def typed(module: ModuleType) -> dict[str, str]:
    """The modules from which a package imports its names for type checkers."""
    tree = ast.parse(Path(str(module.__file__)).read_text())
    return {
        alias.name: str(node.module)
        for block in tree.body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


@pytest.mark.parametrize("module", LAZY, ids=lambda module: module.__name__)
def test_the_lists_of_a_lazy_package_agree(module: ModuleType) -> None:
    """Imports for type checkers, ``__all__``, ``dir()`` and what is imported on first use."""
    homes = {name: path.removeprefix("evoros.") for name, path in typed(module).items()}
    assert homes == vars(module)["_HOMES"]
    assert sorted(module.__all__) == sorted(homes) == dir(module)
    assert all(getattr(module, name) is not None for name in module.__all__)
    with pytest.raises(AttributeError, match=f"module '{module.__name__}' has no attribute 'no'"):
        _ = module.no


OPTIONS = ("config_dir", "display")
"""What is given by name, in this order."""
SUBJECTS = ("config", "folder", "overrides")
FUNCTIONS = ("run", "resume", "load_run", "replay", "evaluate", "Evaluator", "compose")


def arguments(name: str) -> dict[str, inspect.Parameter]:
    return dict(inspect.signature(getattr(evoros, name)).parameters)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_subject_is_first_and_options_are_named(name: str) -> None:
    given = arguments(name)
    assert next(iter(given)) in SUBJECTS
    named = [key for key, value in given.items() if value.kind is value.KEYWORD_ONLY]
    assert named == [key for key in OPTIONS if key in given]
    assert all(given[key].default is None for key in named)


def test_all_functions_are_compared() -> None:
    functions = {name for name in evoros.__all__ if inspect.isfunction(getattr(evoros, name))}
    assert functions == set(FUNCTIONS) - {"Evaluator"}


def test_what_composes_or_runs_takes_the_folder_of_own_parts() -> None:
    assert {name for name in FUNCTIONS if "config_dir" in arguments(name)} == {*FUNCTIONS} - {
        "load_run"
    }
    evaluator, evaluate = arguments("Evaluator"), arguments("evaluate")
    assert list(evaluate) == ["config", "designs", "generation", *OPTIONS]
    assert list(evaluator) == ["config", *OPTIONS]


# Documents ----------------------------------------------------------------------------------


def examples() -> Iterator[tuple[str, str]]:
    """Each block of Python that is shown to users, by its place."""
    plugins = ROOT.glob("evoros/plugins/*/README.md")
    for page in [ROOT / "README.md", *DOCS.rglob("*.md"), *plugins]:
        for block in re.findall(r"^```python\n(.*?)^```$", page.read_text(), re.M | re.S):
            if not page.name.startswith("api"):  # signatures; the docstrings follow
                yield page.name, block
    for module in [*PUBLIC, import_module("evoros.api")]:
        for block in re.findall(r"(?:^ {4}.*\n|^\n)+", inspect.getdoc(module) or "", re.M):
            yield module.__name__, block
    for script in DOCS.glob("*.py"):
        yield script.name, script.read_text()


def private(block: str) -> Iterator[str]:
    """The names of evoros in a block that are not public; a text may begin as they do."""
    modules = {name.split(".")[1] for name in NAMES if "." in name}
    for name in re.findall(r"(?<!['\"])\bevoros\.(\w+)", block):
        if name not in {*evoros.__all__, *modules, "__version__"}:
            yield f"evoros.{name}"
    for home, names in re.findall(r"^ *from (evoros[\w.]*) import (\([^)]*\)|.*)", block, re.M):
        known = NAMES.get(home, set())
        yield from (f"{home}.{name}" for name in re.findall(r"\w+", names) if name not in known)


def test_the_documents_import_public_names_alone() -> None:
    blocks = list(examples())
    assert len(blocks) > 30
    assert [(place, name) for place, block in blocks for name in private(block)] == []


def test_a_private_import_is_found() -> None:
    block = "from evoros.design.design import Design\nfrom evoros import (\n    Mount,\n    no,\n)"
    assert list(private(block)) == ["evoros.design", "evoros.design.design.Design", "evoros.no"]
    assert list(private("import evoros\nevoros.api.run()")) == ["evoros.api"]


def test_the_folder_analysis_has_one_name() -> None:
    with pytest.raises(ImportError, match=r"^analysis: .* import it as evoros\.analysis, "):
        import_module("analysis")
    assert (
        import_module("evoros.analysis.subcommands").Product.__module__
        == "evoros.analysis.subcommands"
    )


def test_a_copy_that_lost_its_links_says_so(tmp_path: Path) -> None:
    """Links as git writes them with ``core.symlinks=false``: files with the link's target."""
    package = tmp_path / "evoros"
    package.mkdir()
    shutil.copy(ROOT / "evoros" / "__init__.py", package)
    (package / "analysis").write_text("../analysis")
    done = subprocess.run(
        [sys.executable, "-c", "import evoros"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: {package}/analysis must be a ")


SLOW = ("pandas", "matplotlib", "hydra", "omegaconf", "pybullet", "rich", "jinja2")


def test_it_offers_all_that_it_imports_and_nothing_else() -> None:
    tree = ast.parse(Path(parts.__file__).read_text())
    imported = [
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]
    assert sorted(parts.__all__) == sorted(imported)
    assert len(set(imported)) == len(imported)


def test_it_offers_every_protocol() -> None:
    """A group's protocols are the classes of its protocol.py that users implement."""
    groups = [path.parent.name for path in (ROOT / "evoros").glob("*/protocol.py")]
    assert len(groups) >= 8
    for group in groups:
        # A design has regions; several observers may be chosen.
        word = {"design": "region_description", "observers": "observer"}.get(group, group)
        name = "".join(part.capitalize() for part in word.split("_"))
        assert name in parts.__all__, group


def test_it_imports_nothing_slow_that_a_mission_does_not_need() -> None:
    code = f"import sys, evoros.parts; print([name for name in {SLOW} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
