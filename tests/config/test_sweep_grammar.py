"""Every form of Hydra's grammar of sweeps gives jobs, or is refused in one line that says why."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proposal_sites import is_of

from evoros.base.errors import InputError
from evoros.config.compose import compose_with_hydra
from evoros.config.jobs import Job, Jobs
from evoros.files.resources import bundled_folder

FAILURES = sorted(path.stem for path in (bundled_folder("conf") / "failure").glob("*.yaml"))


@pytest.fixture(scope="module", autouse=True)
def composed_once() -> Iterator[None]:
    """Compose what the jobs of a form have in common once for all forms: it is the same."""

    @cache
    def compose_once(overrides: tuple[str, ...], config_dir: Path | None, primary: str) -> Any:
        return compose_with_hydra(overrides, config_dir, primary=primary)

    def compose_cached(overrides: Any, folder: Any = None, *_: Any, primary: str = "config") -> Any:
        return compose_once(tuple(overrides), folder, _[1] if _ else primary)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("evoros.config.jobs.compose_with_hydra", compose_cached)
        yield


def expand(typed: str, config_dir: Path | None = None) -> list[str]:
    """The values of the key, as each job gets them."""
    jobs = Jobs([typed], True, config_dir)
    assert all(len(overrides) == 1 for overrides in jobs._overrides)
    return [overrides[0].partition("=")[2] for overrides in jobs._overrides]


@pytest.mark.parametrize(
    ("typed", "values"),
    [
        ("failure=glob(*)", FAILURES),
        ("failure=glob([r*,sp*])", ["random", "spatial"]),
        ("failure=glob(*,exclude=random)", [name for name in FAILURES if name != "random"]),
        ("failure=glob(*, exclude=[r*,s*])", [n for n in FAILURES if n[0] not in "rs"]),
        ("filter@failure.effect=glob(stuck)", ["stuck"]),
        ("controller/avoidance=glob(bl*)", ["blind"]),
        ("failure=none,random", ["none", "random"]),
        ("failure=choice(none,random)", ["none", "random"]),
        ("failure=tag(a,b,choice(none,random))", ["none", "random"]),
        ("seed=range(3)", ["0", "1", "2"]),
        ("seed=range(1,4)", ["1", "2", "3"]),
        ("seed=range(0,10,step=4)", ["0", "4", "8"]),
        ("seed=range(5,1,step=-2)", ["5", "3"]),
        ("trials=range(1,2,0.5)", ["1.0", "1.5"]),
        ("seed=sort(3,1,2)", ["1", "2", "3"]),
        ("seed=sort(range(0,3),reverse=true)", ["2", "1", "0"]),
        ("seed=int(3.0,4)", ["3", "4"]),
        ("seed=float(choice(1,2))", ["1.0", "2.0"]),
        ("seed=str(1,2)", ['"1"', '"2"']),
        ("figures=[overlay],[fitness,mission]", ["[overlay]", "[fitness,mission]"]),
        ("+robot.arguments={a:1},{a:'b,c'}", ["{a:1}", "{a:'b,c'}"]),
        ("+x='a,b',\"it's\"", ["'a,b'", '"it\'s"']),
        ("++seed=1,2", ["1", "2"]),
        ("seed=1,null", ["1", "null"]),
        ("seed=7", ["7"]),
    ],
)
def test_a_form_that_gives_jobs(typed: str, values: list[str]) -> None:
    assert expand(typed) == values


def test_a_value_that_refers_to_another_is_resolved() -> None:
    first = next(iter(Jobs(["seed=${trials},2", "trials=7"], True, None)))
    assert isinstance(first, Job)
    assert first.config.values["seed"] == 7


@pytest.mark.parametrize("typed", ["seed=shuffle(1,2,3,4)", "seed=shuffle(range(1,5))"])
def test_a_shuffle_changes_the_order_alone(typed: str) -> None:
    assert sorted(expand(typed)) == ["1", "2", "3", "4"]


def test_a_glob_finds_the_users_own_files(tmp_path: Path) -> None:
    (tmp_path / "failure").mkdir()
    (tmp_path / "failure" / "zeal.yaml").write_text("{}\n")
    assert expand("failure=glob([z*,none])", tmp_path) == ["none", "zeal"]


def test_a_key_can_be_swept_over_in_place_of_a_parameter_of_the_sweeper() -> None:
    with pytest.raises(InputError) as refused:
        Jobs(["+hydra.sweeper.params.seed='range(2)'"], True, None)
    assert is_of(str(refused.value), "evoros/config/jobs.py seed=0")
    assert len(Jobs([str(refused.value).rpartition("as in ")[2]], True, None)) == 2


@pytest.mark.parametrize(
    ("typed", "why"),
    [
        ("failure=glob(zzz*)", "matches no choice of failure (adversarial"),
        ("seed=glob(*)", "seed is not a group; write the values"),
        ("seed=interval(0,3)", "only a sweeper can choose values"),
        ("seed=tag(a,interval(0,1))", "only a sweeper can choose values"),
        ("seed=range(3,3)", "no values to sweep over; list at least one"),
        ("seed=range(0,3,step=0)", "a nonzero step; write"),
        ("seed=range(0,inf)", "finite ends"),
        ("seed=range(1000000000)", "at most 100000 values"),
        ("seed=range(0,1,1e-12)", "at most 100000 values"),
        ("seed=choice(1,choice(2,3))", "nested sweeps"),
        ("failure=glob(*),none", "nested sweeps"),
        ("~seed=1,2", "type ~seed"),
        ("~failure=glob(*)", "type ~failure"),
        ("hydra.sweep.dir=a,b", "all jobs share it"),
        ("hydra/launcher=glob(*)", "all jobs share it"),
        ("seed=choise(1,2)", "Hydra's grammar has no function choise"),
        *(
            (
                f"seed={value}",
                "must be key=value in Hydra's grammar; correct the word or quote the value",
            )
            for value in ("1,", ",1", "(1,2)", "choice(1,2", "choice()", "range()", "range(a,b)")
        ),
        ("failure=sort(glob(*))", "Hydra's grammar"),
        ("failure=shuffle(glob(*))", "Hydra's grammar"),
        ("failure=tag(x,glob(*))", "Hydra's grammar"),
        ("failure=glob()", "Hydra's grammar"),
        ("seed=choice(range(3))", "Hydra's grammar"),
        ("seed=sort(a,1)", "Hydra's grammar"),
        ("failure=none;random", "Hydra's grammar"),
        ("figures=no_such_function(fitness)", "Hydra's grammar"),
    ],
)
def test_a_form_that_is_refused(typed: str, why: str) -> None:
    """The line names the override; without -m it is refused, too, be it for another reason."""
    with pytest.raises(InputError) as refused:
        Jobs([typed], True, None)
    assert typed in str(refused.value)
    assert why in str(refused.value)
    assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match=r"^[^\n]+$"):
        Jobs([typed], False, None)


@pytest.mark.parametrize(
    "typed", ["failure=glob(*)", "seed=range(3)", "seed=1,2", "seed=tag(a,choice(1,2))"]
)
def test_several_values_need_a_sweep(typed: str) -> None:
    with pytest.raises(InputError, match="several values need a sweep; add -m"):
        Jobs([typed], False, None)


def test_a_product_of_many_values_is_refused() -> None:
    with pytest.raises(InputError, match="has 1000000 jobs, more than 100000"):
        Jobs(["seed=range(1000)", "trials=range(1,1001)"], True, None)


@pytest.mark.slow
@settings(deadline=None)
@given(st.text(alphabet="glob(*),range12' \"[]{}:=~+.$_a", max_size=14))
def test_any_text_gives_jobs_or_one_line(text: str) -> None:
    said = ""
    try:
        said = f"{len(Jobs([f'seed={text}'], True, None))} jobs"
    except InputError as refused:
        said = str(refused)
    assert said
    assert "\n" not in said
    assert said != "0 jobs"
