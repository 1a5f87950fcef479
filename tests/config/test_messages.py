"""A slip in what is typed, or in a file, is one line with the remedy."""

from pathlib import Path

import pytest
from fixture_types import Log

from evoros.base.errors import InputError
from evoros.config.compose import compose, parse
from evoros.config.jobs import Jobs
from evoros.files.plugins import conf_folders
from evoros.files.resources import bundled_folder


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("optimzer.generations=3", "optimizer.generations"),
        ("optimzer.generation=3", "optimizer.generations"),
        ("optimizer.generation=3", "optimizer.generations"),
        ("controler.avoidence.rang_m=3", "controller.avoidance.range_m"),
        ("generations=3", "optimizer.generations"),
        ("seeed=3", "seed"),
    ],
)
def test_a_misspelt_key_is_told_with_the_nearest_existing_one(typed: str, meant: str) -> None:
    with pytest.raises(InputError) as raised:
        compose([typed])
    assert str(raised.value).endswith(f"did you mean {meant}")
    compose([f"{meant}=3"])


def test_a_key_that_a_file_may_have_is_added_as_the_message_says(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r", type \+world\.boxes\.missing=\.\.\.$"):
        compose(["world=boxes", "world.boxes.missing=box"])
    (world,) = compose(["world=boxes", "+world.boxes.missing=box"]).build().world.values()
    assert world.obstacles


@pytest.mark.parametrize("group", ["world", "robot", "controller"])
def test_a_group_without_a_choice_is_told_with_choices_that_work(group: str) -> None:
    files = (file for folder in conf_folders() for file in folder.glob(f"{group}/*.yaml"))
    bundled = sorted(file.stem for file in files)
    for word in (f"{group}=[]", f"~{group}"):
        with pytest.raises(InputError, match=f"^{group}: no choice was made") as raised:
            compose([word]).build()
        typed, _, choices = (
            str(raised.value).partition("type ")[2].partition(", where NAME is one of")
        )
        assert typed == f"{group}=NAME"
        assert choices.removeprefix(": ").split(", ") == bundled
        compose([f"{group}={bundled[-1]}"])


@pytest.mark.parametrize("text", ["Größe", "größe,klein", "Zürich; 50 %"])
def test_a_value_that_lacks_quotes_is_told_with_the_quotes_that_do(text: str) -> None:
    with pytest.raises(InputError) as raised:
        parse([f"treatment.name={text}"])
    proposed = str(raised.value).partition("type ")[2]
    assert proposed == f"'treatment.name=\"{text}\"'"  # the shell's quotes, and Hydra's
    assert compose([proposed[1:-1]]).values["treatment"]["name"] == text


def test_a_default_that_is_added_again_is_told_with_the_word_that_replaces_it(
    tmp_path: Path,
) -> None:
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "again.yaml").write_text(
        "# @package _global_\ndefaults:\n  - /measure@objectives.fitness: cost\n"
    )
    word = "measure@objectives.fitness=cost"
    composed = compose(["optimizer=nsga2", word]).values["objectives"]
    assert composed["fitness"] == composed["fitness"] | {"bounds": [0.0, 50.0]}
    calls = [([f"+{word}"], None), (["experiment=again"], tmp_path)]
    for words, folder in calls:
        with pytest.raises(InputError, match=rf"type {word[:-4]}\.\.\. without \+"):
            compose(["optimizer=nsga2", *words], config_dir=folder)


@pytest.mark.parametrize("line", ["- override @override: {}", "- /nothing: {}"])
def test_a_long_word_in_a_file_does_not_make_a_long_message(line: str, tmp_path: Path) -> None:
    (tmp_path / "experiment").mkdir()
    file = tmp_path / "experiment" / "long.yaml"
    defaults = f"{line.format('a' * 5000)}\n  - override /simulator: planar"
    file.write_text(f"# @package _global_\ndefaults:\n  {defaults}\n")
    with pytest.raises(InputError, match=r"aaa.*; ") as raised:
        compose(["experiment=long"], config_dir=tmp_path)
    assert len(str(raised.value)) < 1200


def test_all_keys_of_another_choice_can_be_dropped_at_once(tmp_path: Path) -> None:
    (tmp_path / "experiment").mkdir()
    keys = "{earliest_s: 2.0, latest_s: 8.0}"
    text = f"# @package _global_\ndefaults: [override /failure: random]\nfailure: {keys}\n"
    (tmp_path / "experiment" / "mine.yaml").write_text(text)
    words = ["experiment=mine", "failure=none"]
    drops = ["~failure.earliest_s", "~failure.latest_s"]
    with pytest.raises(InputError, match=f"or type {' '.join(drops)}$"):
        compose(words, config_dir=tmp_path).build()
    compose([*words, *drops], config_dir=tmp_path).build()


def test_an_unknown_key_is_told_with_the_file_that_has_it(tmp_path: Path) -> None:
    (tmp_path / "fitness").mkdir()
    file = tmp_path / "fitness" / "priced.yaml"
    file.write_text("defaults: [equation_one, _self_]\nprice_wait: 3 # not price_weight\n")
    with pytest.raises(InputError, match=f"unknown key 'price_wait'.* in {file}$"):
        compose(["fitness=priced"], config_dir=tmp_path).build()
    with pytest.raises(InputError, match=r"unknown key 'price'; .* spelling$"):
        compose(["+fitness.price=3"], config_dir=tmp_path).build()


def test_a_key_of_another_choice_is_told_with_its_choice_and_dropped_as_the_message_says(
    tmp_path: Path,
) -> None:
    """The choice changes, and the keys that were meant for the earlier one remain."""
    (tmp_path / "experiment").mkdir()
    file = tmp_path / "experiment" / "mine.yaml"
    head = "# @package _global_\ndefaults: [override /failure: given]\n"
    file.write_text(f"{head}failure: {{sensors: [0]}}\n")
    words = ["experiment=mine", "failure=none"]
    belongs = "only given in the group failure has this key; "
    with pytest.raises(InputError, match=rf"{belongs}remove it in {file}, or type (\S+)$") as told:
        compose(words, config_dir=tmp_path).build()
    compose([*words, str(told.value).split()[-1]], config_dir=tmp_path).build()
    with pytest.raises(
        InputError, match=f"{belongs}leave the key out, or change the choice of failure"
    ):
        compose(["failure=none", "failure.sensors=[0]"])
    assert compose(["failure=given", "failure.sensors=[0]"]).values["failure"]["sensors"] == [0]


def test_callbacks_of_hydra_are_refused_and_not_ignored() -> None:
    with pytest.raises(InputError, match=r"hydra\.callbacks: .* leave the key out"):
        Jobs(["+hydra.callbacks.mine._target_=mine.Callback"], False, None)


def test_a_file_that_a_bundled_one_hides_is_told(tmp_path: Path, caplog: Log) -> None:
    for name in ("none", "mine"):
        (tmp_path / "failure").mkdir(exist_ok=True)
        (tmp_path / "failure" / f"{name}.yaml").write_text("{}")
    assert "_target_" in compose(["failure=none"], config_dir=tmp_path).values["failure"]
    (message,) = (record.getMessage() for record in caplog.records)
    own, bundled = (
        folder / "failure" / "none.yaml" for folder in (tmp_path, bundled_folder("conf"))
    )
    assert message == f"{own}: not used, because {bundled} has the same name; rename your file"
