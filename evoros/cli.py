"""The command ``evoros``: arguments, Hydra, messages and exit statuses.

Exit statuses: 0 done; 1 stopped, resumable; 2 input that cannot be used; 130 interrupted.
"""

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from evoros.assets import folder
from evoros.errors import EvorosError, InputError, RunStopped

DONE, STOPPED, INPUT, INTERRUPTED = 0, 1, 2, 130


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evoros(sys.argv[1:]))


def evoros(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit status."""
    from evoros.progress import logging_to_terminal

    with logging_to_terminal(), _terminable():
        try:
            if any(argument.startswith("resume=") for argument in arguments):
                return _resume(arguments)
            return _compose_and_run(arguments)
        except KeyboardInterrupt:
            return _say("interrupted", INTERRUPTED)
        except EvorosError as error:
            return _say(str(error), _status(error))


def _resume(arguments: Sequence[str]) -> int:
    """``evoros resume=FOLDER [executor...] [optimizer.generations=N]``."""
    rest = _with_config_dir(arguments, strip=True)
    target = next(argument for argument in rest if argument.startswith("resume="))
    path = Path(target.partition("=")[2]).expanduser()
    overrides = [argument for argument in rest if argument is not target]

    from evoros.session import resume

    return _session(path, lambda display: resume(path, overrides, display), live=True)


def _compose_and_run(arguments: Sequence[str]) -> int:
    """Let Hydra compose one job or the jobs of a sweep; each is a run."""
    _with_config_dir(arguments, strip=False)
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra then raises what it would print at length

    import hydra
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode
    from omegaconf import DictConfig

    from evoros import config as configuration
    from evoros.session import start

    statuses: list[int] = []

    def job(config: DictConfig) -> None:
        settings = HydraConfig.get()
        path = Path(settings.runtime.output_dir)
        alone = settings.mode == RunMode.RUN
        statuses.append(_session(_short(path), lambda d: start(config, _short(path), d), alone))
        if statuses[-1] == INTERRUPTED:
            raise KeyboardInterrupt

    sys.argv = ["evoros", *arguments]
    decorate = hydra.main(version_base="1.3", config_path=str(folder("conf")), config_name="config")
    try:
        decorate(job)()
    except configuration.CONFIG_ERRORS as error:
        raise InputError(configuration.one_line(error)) from error
    except SystemExit as stop:  # argparse has said what is wrong
        return int(stop.code or 0)
    return max(statuses, default=DONE)


def _session(path: Path, work: object, live: bool) -> int:
    """One run, its display and what is said at its end; returns an exit status."""
    from evoros.progress import Progress
    from evoros.summary import summary

    display = Progress(live and sys.stderr.isatty())
    try:
        work(display)  # type: ignore[operator]
    except KeyboardInterrupt:
        display.close()
        return _say(f"interrupted; to continue type: evoros resume={path}", INTERRUPTED)
    except RunStopped as error:
        display.close()
        return _say(f"{error}\nstopped; to continue type: evoros resume={path}", STOPPED)
    except EvorosError as error:
        display.close()
        return _say(str(error), _status(error))
    display.close()
    print(summary(path))
    return DONE


def _status(error: EvorosError) -> int:
    return INPUT if isinstance(error, InputError) else STOPPED


def _say(message: str, status: int) -> int:
    from evoros.progress import LOGGER

    LOGGER.error("evoros: %s", message)
    return status


def _short(path: Path) -> Path:
    """Relative to the current folder where the path lies below it: it is typed again."""
    try:
        return path.relative_to(Path.cwd())
    except ValueError:
        return path


def _with_config_dir(arguments: Sequence[str], strip: bool) -> list[str]:
    """Make modules beside the user's own configuration importable; returns the arguments.

    With ``strip``, the option itself is left out of them.
    """
    from evoros.config import own_folder

    rest, following = [], False
    for argument in arguments:
        name, sign, value = argument.partition("=")
        if following or (name in ("--config-dir", "-cd") and sign):
            own_folder(argument if following else value)
            following = False
        elif argument in ("--config-dir", "-cd"):
            following = True
        else:
            rest.append(argument)
    return rest if strip else list(arguments)


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM end the run as cleanly as Ctrl-C does."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise RunStopped("terminated by a signal")

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
