"""Lines about how files were read, on a terminal and in the log of a run; long commands tell."""

import logging
import time
from pathlib import Path
from threading import Thread, active_count

from fixture_types import Capture, Log, Patch

from evoros.preflight.preflight import check_robots
from evoros.terminal import activity
from evoros.terminal.activity import announce, tell_slow
from evoros.terminal.log import (
    LOGGER,
    attach,
    collect_messages,
    format_for_terminal,
    log_everything,
    log_for_job,
    log_to_file,
    log_to_terminal,
    read_again,
    withhold_messages,
)

READER = logging.getLogger("evoros.sdf")
PREFLIGHT = logging.getLogger(check_robots.__module__)


def test_a_terminal_shows_a_line_of_a_reader_once_for_all_jobs(capsys: Capture) -> None:
    with log_to_terminal():
        for job in ("a", "b"):
            with log_for_job(f"sweep/{job}"):
                READER.warning("w.sdf: two models are left out")
                LOGGER.warning("mission 3 is lost")
    shown = capsys.readouterr().err.splitlines()
    assert shown == [
        "a: w.sdf: two models are left out",
        "a: mission 3 is lost",
        "b: mission 3 is lost",
    ]


def test_a_sweep_shows_a_warning_of_preflight_once_wherever_its_jobs_run(capsys: Capture) -> None:
    """A job of a launcher of Hydra opens the terminal again, and a screen has its own handler."""
    for job in ("a", "b"):
        with log_to_terminal(again=job != "a"), log_for_job(f"sweep/{job}"):
            PREFLIGHT.warning("scout: chosen for the robot")
    with attach(format_for_terminal(logging.StreamHandler())):
        PREFLIGHT.warning("scout: chosen for the robot")
    assert capsys.readouterr().err == "a: scout: chosen for the robot\n"
    with log_to_terminal():  # another command
        PREFLIGHT.warning("scout: chosen for the robot")
    assert capsys.readouterr().err == "scout: chosen for the robot\n"


def test_details_reach_the_log_alone(tmp_path: Path, capsys: Capture) -> None:
    log = tmp_path / "run.log"
    with log_to_terminal():
        with collect_messages() as messages:
            READER.warning("model a is left out (and 1 more of this kind)")
            READER.debug("model b is left out")
        with log_to_file(log, messages):
            pass
    assert "model b" not in capsys.readouterr().err
    assert "model a is left out (and 1 more" in log.read_text()
    assert "model b is left out" in log.read_text()


def test_lines_that_a_log_has_are_counted_in_one(tmp_path: Path, capsys: Capture) -> None:
    log = tmp_path / "run.log"

    def read(*lines: str) -> None:
        for line in lines:
            READER.warning(line)

    with log_to_terminal():
        with log_to_file(log):
            read("first", "second")
        capsys.readouterr()
        with read_again(log):
            read("first", "second", "third", "fir")
    assert capsys.readouterr().err.splitlines() == [
        "third",
        "fir",
        f"see {log} for 2 lines about how files were read",
    ]


def test_a_log_that_cannot_be_read_withholds_nothing(tmp_path: Path, capsys: Capture) -> None:
    for log in (tmp_path / "none.log", tmp_path):
        with log_to_terminal(), read_again(log):
            READER.warning("first")
        assert capsys.readouterr().err == "first\n"


def test_control_characters_of_others_reach_no_terminal_and_no_log(
    capsys: Capture, tmp_path: Path
) -> None:
    with log_to_terminal(), log_to_file(tmp_path / "log"):
        LOGGER.warning("pilot said %s", "\x1b[2J\x1b]0;owned\x07 gr\u00fc\u00dfe\u9b27\x85")
    plain = "pilot said \\x1b[2J\\x1b]0;owned\\x07 gr\u00fc\u00dfe\u9b27\\x85\n"
    assert capsys.readouterr().err == plain
    assert (tmp_path / "log").read_text().endswith(plain)


def test_runs_in_threads_leave_the_level_as_it_was_in_whatever_order_they_end() -> None:
    before = LOGGER.level
    first, second = log_everything(), log_everything()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert LOGGER.level == logging.DEBUG
    second.__exit__(None, None, None)
    assert LOGGER.level == before


def test_only_messages_of_the_thread_are_withheld(capsys: Capture) -> None:
    """Those of all loggers, and by the innermost."""
    with log_to_terminal(), withhold_messages() as outer:
        READER.warning("first")
        with withhold_messages() as inner:
            READER.warning("second")
            other = Thread(target=READER.warning, args=("of another",))
            other.start()
            other.join()
        LOGGER.warning("third")
    assert [record.getMessage() for record in outer] == ["first", "third"]
    assert [record.getMessage() for record in inner] == ["second"]
    assert capsys.readouterr().err == "of another\n"


def test_what_takes_long_is_told_even_while_messages_are_withheld(
    caplog: Log, monkeypatch: Patch
) -> None:
    monkeypatch.setattr(activity, "SLOW_S", 0.02)
    with caplog.at_level(logging.INFO), tell_slow("reading city.world"):
        with withhold_messages() as withheld, announce("dividing house.dae"):
            while not any("house.dae" in message for message in caplog.messages):
                time.sleep(0.01)
        while not any("city.world" in message for message in caplog.messages[1:]):
            time.sleep(0.01)
    assert not withheld
    assert all(message.endswith(" s so far") for message in caplog.messages)


def test_what_is_quick_is_not_told_and_leaves_no_thread(caplog: Log) -> None:
    threads = active_count()
    with caplog.at_level(logging.INFO), tell_slow("reading"):
        pass
    assert not caplog.messages
    assert active_count() == threads
