"""The commands of docs/ladder.md have choices, keys and options that exist."""

import re
import subprocess

from documents import split_command, text

from evoros.analysis.subcommands import parse
from evoros.files.plugins import conf_folders

PAGE = text("ladder")
OWN = {"designs", "hydra", "world", "seed", "trials", "figures"}  # no groups, or checked elsewhere


def lines() -> list[list[str]]:
    blocks = re.findall(r"^```bash\n(.*?)^```$", PAGE, re.M | re.S)
    return [split_command(line) for block in blocks for line in block.splitlines()]


def test_choices_and_keys_exist() -> None:
    for name, *words in lines():
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
    made = [w.partition("=")[2] for _, *words in lines() for w in words if "run.dir=" in w]
    (drawn,) = (parse(words) for name, *words in lines() if name == "evoros analyze")
    assert drawn.ladder
    assert [str(folder) for folder in drawn.folders] == made


def test_a_shell_takes_every_line() -> None:
    for block in re.findall(r"^```bash\n(.*?)^```$", PAGE, re.M | re.S):
        checked = subprocess.run(["bash", "-n"], input=block, capture_output=True, text=True)
        assert checked.stderr == ""
