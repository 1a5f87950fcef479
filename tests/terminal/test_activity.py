"""A command that takes long says what it does; one that is quick says nothing."""

import logging
import time
from threading import active_count

from fixture_types import Log

from evoros.terminal.activity import announce, tell_slow
from evoros.terminal.log import withhold_messages


def test_what_takes_long_is_told_even_while_messages_are_withheld(caplog: Log) -> None:
    with caplog.at_level(logging.INFO), tell_slow("reading city.world", 0.02):
        with withhold_messages() as withheld, announce("dividing house.dae"):
            while not any("house.dae" in message for message in caplog.messages):
                time.sleep(0.01)
        while not any("city.world" in message for message in caplog.messages[1:]):
            time.sleep(0.01)
    assert not withheld
    assert all(message.endswith(" s so far") for message in caplog.messages)


def test_what_is_quick_is_not_told_and_leaves_no_thread(caplog: Log) -> None:
    threads = active_count()
    with caplog.at_level(logging.INFO), tell_slow("reading", 60.0):
        pass
    assert not caplog.messages
    assert active_count() == threads
