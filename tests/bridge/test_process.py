"""Whatever is killed, nothing of a process outside remains; and what cannot start is told."""

import json
import os
import signal
import socket
import subprocess
import sys
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest
from executor_calls import wait_until
from proposal_sites import is_of

from evoros.base.errors import LaunchError, PilotLost
from evoros.bridge import process as process_module
from evoros.bridge.process import start_process

WORKER = """
import json, sys
from evoros.bridge.process import start_process
command, isolate, mark = json.loads(sys.argv[1])
with start_process(command, isolate=isolate, environment={"MARK": mark}) as process:
    print("started", flush=True)
    sys.stdin.readline() or process.running(wait_s=600)
print("left", flush=True)
"""
FAMILY = """
import os, sys, time
open("file", "w").close()
os.makedirs("a/b"); os.chmod("a/b", 0); os.chmod("a", 0)
if os.fork() == 0:
    os.setsid()
    if os.fork() > 0:
        os._exit(0)
    os.execvp("sleep", ["sleep", "600"])
os.wait()
if len(sys.argv) > 1:
    open("/dev/shm/" + os.environ["MARK"], "w").close()
print("ready", flush=True)
time.sleep(600)
"""


def find_marked(mark: str) -> list[int]:
    """The processes that were started with the mark in their environment."""
    pids = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):
            if f"MARK={mark}".encode() in path.read_bytes().split(b"\0"):
                pids.append(int(path.parent.name))
    return pids


def no_marked(mark: str) -> bool:
    return not find_marked(mark)


def name_of(process: int) -> str:
    """The program that the process executes; empty if it has ended since it was found."""
    try:
        words = Path(f"/proc/{process}/cmdline").read_text().split("\0")
    except OSError:
        return ""
    return "keeper" if any(word.endswith("keeper.py") for word in words) else words[0]


@dataclass
class Family:
    """A worker with a process outside, which has a grandchild in a session of its own."""

    worker: "subprocess.Popen[str]"
    mark: str
    temporary: Path

    def find(self, name: str) -> int:
        """The first of that name: in a namespace, the keeper's child bears its name, too."""
        return min(pid for pid in find_marked(self.mark) if name_of(pid) == name)

    def gone(self) -> bool:
        return not find_marked(self.mark) and not list(self.temporary.iterdir())


@pytest.fixture(params=[True, False], ids=["isolated", "not isolated"])
def family(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Family]:
    mark, temporary = uuid.uuid4().hex, tmp_path / "temporary"
    temporary.mkdir()
    program = tmp_path / "family.py"
    program.write_text(FAMILY)
    shared = ["shared"] if request.param else []
    command = [sys.executable, "-I", "-S", str(program), *shared]
    order = json.dumps([command, request.param, mark])
    with subprocess.Popen(
        [sys.executable, "-c", WORKER, order],
        env={**os.environ, "TMPDIR": str(temporary)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as worker:
        assert worker.stdout is not None
        assert worker.stdout.readline() == "started\n"
        assert wait_until(lambda: "sleep" in map(name_of, find_marked(mark)))
        yield Family(worker, mark, temporary)
        worker.kill()
    assert not Path("/dev/shm", mark).exists()


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, "leaves"])
def test_nothing_remains_of_a_worker(family: Family, how: signal.Signals | str) -> None:
    if isinstance(how, str):
        family.worker.communicate("leave\n", timeout=100)
    else:
        family.worker.send_signal(how)
    assert wait_until(family.gone), (find_marked(family.mark), list(family.temporary.iterdir()))


@pytest.mark.parametrize("victim", ["keeper", sys.executable])
def test_nothing_remains_of_a_killed_one(family: Family, victim: str) -> None:
    os.kill(family.find(victim), signal.SIGKILL)
    output, _ = family.worker.communicate(timeout=100)  # the worker notices, and leaves
    assert output == "left\n"
    # The kernel ends the namespace of a killed keeper, and nobody waits for that.
    assert wait_until(family.gone), (find_marked(family.mark), list(family.temporary.iterdir()))


def test_a_stopped_keeper_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_module, "END_LIMIT_S", 0.2)
    for isolate in (True, False):
        mark = uuid.uuid4().hex
        with start_process(["sleep", "600"], isolate=isolate, environment={"MARK": mark}):
            keeper = min(pid for pid in find_marked(mark) if name_of(pid) == "keeper")
            os.kill(keeper, signal.SIGSTOP)
        if isolate:  # its namespace dies with it, and nobody waits for that
            wait_until(partial(no_marked, mark))
        assert no_marked(mark)


@pytest.mark.parametrize("isolate", [True, False])
@pytest.mark.parametrize("how", ["missing", "not executable", "no interpreter", "a folder"])
def test_what_cannot_be_executed_is_one_line(tmp_path: Path, how: str, isolate: bool) -> None:
    program, why = tmp_path / "program", "Permission denied"
    if how in ("missing", "no interpreter"):
        why = "No such file or directory"
    if how == "a folder":
        program.mkdir()
    elif how != "missing":
        program.write_text("#!/no/such/interpreter\n")
        program.chmod(0o755 if how == "no interpreter" else 0o644)
    rule = rf"^{program}: cannot be executed \({why}\); correct the "
    with pytest.raises(LaunchError, match=rule), start_process([str(program)], isolate=isolate):
        pass


def test_a_system_without_namespaces_is_one_line() -> None:
    """A container that allows none is so: a user namespace whose limits are 0."""
    limits = " ".join(f"max_{name}_namespaces" for name in ("net", "pid", "mnt", "ipc", "user"))
    deny = f'cd /proc/sys/user && for f in {limits}; do echo 0 > $f; done && exec "$@"'
    try_it = """
import sys
from evoros.base.errors import LaunchError
from evoros.bridge.process import start_process
for isolate in (True, False):
    try:
        with start_process(["true"], isolate=isolate) as process:
            print("runs" if not process.running(wait_s=100) else "hangs")
    except LaunchError as error:
        print(error)
"""
    command = ["unshare", "-Ur", "sh", "-c", deny, "sh", sys.executable, "-c", try_it]
    result = subprocess.run(command, capture_output=True, text=True, timeout=250, check=False)
    if "unshare failed" in result.stderr:
        pytest.skip("not even the test may make a user namespace")
    isolated, together = result.stdout.splitlines()
    assert is_of(isolated, "evoros/bridge/process.py controller.isolate=false")
    assert "(unshare: No space left on device)" in isolated
    assert together == "runs", result.stderr


def test_a_keeper_that_is_killed_before_the_start_loses_its_mission_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is no system without namespaces, on which every mission would be lost."""
    begin = process_module._start_keeper

    def kill(*arguments: object) -> "subprocess.Popen[bytes]":
        keeper = begin(*arguments)  # type: ignore[arg-type]
        keeper.kill()
        return keeper

    monkeypatch.setattr(process_module, "_start_keeper", kill)
    with pytest.raises(PilotLost, match=r"true was not .* killed"), start_process(["true"]):
        pytest.fail("nobody has started it")


def test_news_that_arrive_together_are_read_one_by_one() -> None:
    """So it is when the command has ended before its start is read, in a busy machine."""
    ours, theirs = socket.socketpair()
    reader, writer = os.pipe()
    with ours, theirs, open(reader, "rb"), open(writer, "wb"):
        theirs.sendall(b'{"started": []}\n{"ended": 0}\n{"cut"')
        socket.send_fds(theirs, [b': 1}\n{"last": 2}\n'], [writer])
        theirs.close()
        assert process_module._receive(ours) == ({"started": []}, [])
        assert process_module._receive(ours) == ({"ended": 0}, [])
        news, descriptors = process_module._receive(ours, 1)
        assert news == {"cut": 1}
        (descriptor,) = descriptors
        assert os.fstat(descriptor).st_ino == os.fstat(writer).st_ino
        os.close(descriptor)
        assert process_module._receive(ours) == ({"last": 2}, [])
        assert process_module._receive(ours) == ({}, [])


def test_macos_is_told_before_anything_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    with (
        pytest.raises(LaunchError, match="requires Linux, not darwin; use"),
        start_process(["true"]),
    ):
        pass


def test_four_at_once_do_not_hear_each_other(tmp_path: Path) -> None:
    program = tmp_path / "port.py"
    program.write_text(
        "import os, socket, time\n"
        "own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)\n"
        "own.bind(('127.0.0.1', 14550))\n"
        "own.sendto(os.environ['MARK'].encode(), ('127.0.0.1', 14550))\n"
        "time.sleep(0.2)\n"
        "print('heard', own.recv(99).decode(), flush=True)\n"
        "own.settimeout(0.2)\n"
        "try:\n"
        "    print('and', own.recv(99).decode())\n"
        "except TimeoutError:\n"
        "    print('alone')\n"
    )
    with ExitStack() as stack:
        command = [sys.executable, "-I", "-S", str(program)]
        started = [
            stack.enter_context(start_process(command, environment={"MARK": str(index)}))
            for index in range(4)
        ]
        for index, process in enumerate(started):
            assert not process.running(wait_s=100.0)
            assert process.read_log() == f"heard {index}\nalone\n"
