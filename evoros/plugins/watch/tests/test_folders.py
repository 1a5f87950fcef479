"""Folders yield states, logs, and whether their figures would change."""

import fcntl
import os
import shutil
import time
from pathlib import Path

import pytest
from helpers import copied, cut, finished_run
from markupsafe import Markup
from proposal_sites import is_of

from evoros.analysis.report.frame import Page
from evoros.analysis.report.playback import Flown, encode_playback, encode_shown
from evoros.analysis.tables.loading import load_study
from evoros.base.errors import InputError
from evoros.executor.processes import available_cores
from evoros.plugins.watch.flight import fly_best
from evoros.plugins.watch.folders import Folders, name_runs
from evoros.plugins.watch.server import (
    Contents,
    describe_state,
    draw_parts,
    make_contents,
    render_progress,
)
from evoros.plugins.watch.watcher import SHARE, Flights, Watcher


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("watched") / "run", "record=all")


def interrupted(run: Path, to: Path) -> Path:
    cut(copied(run, to), len((run / "missions.csv").read_bytes()) - 200)
    return to


def content_of(folder: Path) -> dict[str, tuple[int, bytes]]:
    files = [file for file in folder.rglob("*") if file.is_file()]
    return {str(file): (file.stat().st_mtime_ns, file.read_bytes()) for file in files}


def test_two_looks_at_the_same_files_are_equal_and_a_new_generation_differs(
    finished: Path, tmp_path: Path
) -> None:
    run = interrupted(finished, tmp_path / "run")
    folders = Folders([tmp_path])
    first = folders.look()
    assert folders.look() == first
    (run / "evoros.log").open("a").write("2100-01-01 00:00:00,000 INFO more\n")
    second = folders.look()
    assert second.stamps == first.stamps  # a message changes no figure
    assert second.log[-1] == "2100-01-01 00:00:00 more"
    done = len([*(run / "generations").iterdir()])
    shutil.copy(finished / f"generations/{done:05d}.csv", run / "generations")
    assert folders.look().stamps != first.stamps


def test_the_state_is_that_of_the_most_lively_run(finished: Path, tmp_path: Path) -> None:
    folders = Folders([tmp_path / "sweep", tmp_path / "later"])
    assert describe_state(folders.look().overviews) == "waiting"
    copied(finished, tmp_path / "sweep" / "seed-0")
    look = folders.look()
    assert describe_state(look.overviews) == "finished"
    assert look.empty == (tmp_path / "later",)
    interrupted(finished, tmp_path / "sweep" / "seed-1")
    look = folders.look()
    assert describe_state(look.overviews) == "running"
    section = render_progress(look, "no <paper>")
    assert "seed-1" in section
    assert "no &lt;paper&gt;" in section
    assert "later has no run yet" in section


def test_runs_are_named_by_what_differs() -> None:
    paths = [Path(f"/s/size-8_seed-{seed}_failure-{f}") for seed in (0, 1) for f in ("a", "b")]
    names = list(name_runs(paths).values())
    assert names == [f"seed-{seed}_failure-{f}" for seed in (0, 1) for f in ("a", "b")]
    assert name_runs(paths[:1]) == {paths[0]: paths[0].name}
    same = [Path("/a/run"), Path("/b/run")]
    assert len(set(name_runs(same).values())) == 2


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_what_has_no_run_and_never_will_is_refused(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "thing"
    if kind == "folder":
        path.mkdir()
        (path / "photo.png").touch()
    else:
        path.touch()
    with pytest.raises(InputError, match=r"give (such a|the) folder"):
        Folders([path]).check()


def test_what_is_to_come_is_waited_for(tmp_path: Path) -> None:
    (tmp_path / "empty" / "inner").mkdir(parents=True)
    Folders([tmp_path / "missing", tmp_path / "empty"]).check()


def test_a_link_or_a_pipe_in_place_of_a_log_is_not_read(finished: Path, tmp_path: Path) -> None:
    run = copied(finished, tmp_path / "run")
    (run / "evoros.log").unlink()
    os.mkfifo(run / "evoros.log")
    assert Folders([run]).look().log == ()


@pytest.fixture(scope="module")
def drawn(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Watcher]:
    """A watcher that has drawn an interrupted run, and has written nothing into its folder."""
    run = interrupted(finished, tmp_path_factory.mktemp("drawn") / "run")
    before = content_of(run)
    watcher = Watcher(Folders([run]))
    watcher.look()
    assert watcher.give().find("part/figures") is None
    watcher.draw(watcher.folders.look())
    watcher.look()
    assert content_of(run) == before
    return run, watcher


def read(contents: Contents, address: str) -> bytes:
    content = contents.find(address)
    assert content is not None
    return content.data


def test_the_page_draws_and_plays_what_the_report_does(drawn: tuple[Path, Watcher]) -> None:
    contents = drawn[1].give()
    assert b"<svg" in read(contents, "part/figures")
    assert b"data-key" in read(contents, "part/missions")
    assert b"data-player" in read(contents, "part/player")
    whole = read(contents, "")
    assert all(read(contents, name) in whole for name in ("part/figures", "part/progress"))


def test_a_damaged_run_is_told_and_the_page_stays(drawn: tuple[Path, Watcher]) -> None:
    run, watcher = drawn
    whole = (run / "setting.json").read_bytes()
    (run / "setting.json").write_text("{")
    watcher.draw(watcher.folders.look())
    watcher.look()
    (run / "setting.json").write_bytes(whole)
    contents = watcher.give()
    assert b"Figures are not drawn" in read(contents, "part/progress")
    assert b"setting.json" in read(contents, "part/progress")
    assert b"<svg" in read(contents, "part/figures")


@pytest.mark.slow
def test_drawing_pauses_until_it_has_used_no_more_than_its_share(
    drawn: tuple[Path, Watcher], monkeypatch: pytest.MonkeyPatch
) -> None:
    class PausedError(Exception):
        pass

    def pause(duration_s: float) -> None:
        raise PausedError(duration_s)

    watcher = Watcher(Folders([drawn[0]]))
    watcher.look()
    watcher.give()
    begun_s = time.thread_time()
    monkeypatch.setattr(time, "sleep", pause)
    with pytest.raises(PausedError) as paused:
        watcher._draw_again()
    used_s = time.thread_time() - begun_s
    (pause_s,) = paused.value.args
    assert used_s > 0.1  # it has drawn
    assert used_s / (used_s + pause_s) <= SHARE * available_cores()


def test_a_name_cannot_end_the_script_that_holds_the_state() -> None:
    drawn, progress = draw_parts(Page("</script><b>")), ("Progress", Markup())
    page = read(make_contents("</script><b>", drawn, progress, {"state": "</script><b>"}), "")
    assert b"</script><b>" not in page


# Flights ---------------------------------------------------------------------------------------

PLANAR = ("simulator=planar", "record=all", "failure=random")


@pytest.mark.slow
def test_missions_flown_again_are_those_that_were_recorded(tmp_path: Path) -> None:
    run = interrupted(finished_run(tmp_path / "whole", *PLANAR), tmp_path / "run")
    (record,) = load_study([run]).records
    recorded = encode_playback(record)
    assert encode_shown(fly_best(record)) == recorded
    shutil.rmtree(run / "trajectories")
    flights = Flights()
    with (run / "missions.csv").open("rb") as missions:
        fcntl.flock(missions, fcntl.LOCK_EX)  # as the process of a run does
        assert flights.update(load_study([run])) == Flown(
            {"run": recorded}, ["Missions rerun for this page, because the run stores none: run."]
        )
        flights.close()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Flights, "_fly", None)  # the same design is not flown twice
            assert flights.update(load_study([run])).playbacks == {"run": recorded}


@pytest.mark.parametrize("recorded", ["none", "all"])
def test_missions_that_are_not_flown_again_can_be_recorded(recorded: str, tmp_path: Path) -> None:
    run = finished_run(tmp_path / "whole", f"record={recorded}")
    flown = Flights().update(load_study([interrupted(run, tmp_path / "run")]))
    told = is_of("".join(flown.notes), "evoros/plugins/watch/watcher.py record=all")
    assert told == (recorded == "none")


def test_a_run_that_does_not_run_is_not_flown(tmp_path: Path) -> None:
    run = interrupted(finished_run(tmp_path / "whole", *PLANAR), tmp_path / "run")
    shutil.rmtree(run / "trajectories")
    study = load_study([run])
    flown = Flights().update(study)
    assert not flown.playbacks
    (note,) = flown.notes
    assert "is not in progress, or was started by another user" in note
