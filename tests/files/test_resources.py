"""Files that a configuration names: the user's, or bundled ones."""

import logging
import shutil
from pathlib import Path

import pytest

from evoros.files.resources import bundled_folder, find_file

NAME = "erle_rover/erle_rover.xacro"
BUNDLED = bundled_folder("robots") / NAME


@pytest.mark.parametrize("here", ["absent", "present", "linked", "started among the bundled"])
def test_a_file_in_the_current_folder_wins_over_a_bundled_one_and_it_is_told(
    here: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.chdir(bundled_folder("robots") if here.startswith("started") else tmp_path)
    own = tmp_path / NAME
    own.parent.mkdir()
    if here == "present":
        shutil.copy(BUNDLED, own)
    elif here == "linked":
        own.symlink_to(BUNDLED)
    with caplog.at_level(logging.WARNING):
        found = find_file(NAME, "robots")
    assert found == (own if here == "present" else BUNDLED)
    told = [f"{own}: used instead of {BUNDLED}; to use the latter, rename the former"]
    assert [record.getMessage() for record in caplog.records] == told * (here == "present")
