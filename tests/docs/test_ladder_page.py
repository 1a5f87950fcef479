"""The commands of docs/ladder.md have choices, keys and options that exist."""

import re

from documents import shell_lines, split_command, text

from evoros.analysis.subcommands import parse
from evoros.files.plugins import conf_folders

LINES = [split_command(line) for line in shell_lines(text("ladder"))]
OWN = {"designs", "hydra", "world", "seed", "trials", "figures"}  # no groups, or checked elsewhere


def test_choices_and_keys_exist() -> None:
    for name, *words in LINES:
        assert name in ("evoros", "evoros evaluate", "evoros analyze")
        for word in words if name != "evoros analyze" else []:
            key, _, value = word.partition("=")
            group, *field = key.split(".")
            if group in OWN or key == "-m":
                continue
            if field:
                files = (
                    file for folder in conf_folders() for file in folder.glob(f"{group}/*.yaml")
                )
                assert any(re.search(rf"^{field[0]}:", file.read_text(), re.M) for file in files)
            else:
                assert any(
                    (folder / group / f"{value}.yaml").exists() for folder in conf_folders()
                ), word


def test_the_ladder_is_drawn_of_the_evaluations_that_are_made() -> None:
    made = [w.partition("=")[2] for _, *words in LINES for w in words if "run.dir=" in w]
    (drawn,) = (parse(words) for name, *words in LINES if name == "evoros analyze")
    assert drawn.ladder
    assert [str(folder) for folder in drawn.folders] == made
