"""The contents that travel to workers elsewhere, and how often; which workers fit."""

import json
import math
import os
import pickle
import subprocess
import sys
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import pytest
from executor_calls import square
from fixture_types import Log, Patch
from helpers import ROOT
from numba.np.random import _constants

from evoros.base.errors import InputError, RunStopped
from evoros.executor.protocol import (
    KEPT,
    MISSING,
    RETURNED,
    Kept,
    MissingError,
    Shared,
    unpack_call,
)
from evoros.executor.worker_handle import Limits
from evoros.plugins.clusters import companion
from evoros.plugins.clusters.companion import Request, UserModules, unpack_modules
from evoros.plugins.clusters.node import (
    ARITHMETIC,
    LIBRARY,
    REFUSED,
    describe_environment,
    draw_deviates,
    has_library,
    list_differences,
)
from evoros.plugins.clusters.remote import RawAnswer, RemotePool

LIMITS = Limits(time_limit_s=60.0)


@pytest.fixture(autouse=True)
def _without_tests(monkeypatch: Patch) -> None:
    """Leave the modules of the tests out of what travels, which would be packed for each pool."""
    others = {name: m for name, m in sys.modules.items() if not is_of_tests(m)}
    monkeypatch.setattr(sys, "modules", others)


def is_of_tests(module: object) -> bool:
    file = Path(getattr(module, "__file__", None) or "")
    return "tests" in file.parts[len(ROOT.parts) :]  # the clone itself may have this name


@dataclass
class Carrier:
    """Workers of this process that keep contents, each call's in turn; some do not fit."""

    kept: dict[str, Kept]
    unfit: set[str] = field(default_factory=set)
    sent: list[tuple[str, bytes]] = field(default_factory=list)  # contents, by worker
    stopped: list[str] = field(default_factory=list)
    turn: int = 0
    hold: bool = False

    @property
    def workers(self) -> int:
        return len(self.kept) - len(self.unfit)

    def send(
        self, name: str, wanted: dict[str, str], request: bytes, node: str | None
    ) -> "Future[RawAnswer]":
        assert wanted == dict(describe_environment())
        self.turn += 1
        chosen = node or list(self.kept)[self.turn % len(self.kept)]
        future: Future[RawAnswer] = Future()
        if not self.hold:
            future.set_result((*self.run(chosen, pickle.loads(request)), chosen != "odd", chosen))
        return future

    def run(self, node: str, request: Request) -> tuple[int, bytes]:
        if node in self.unfit:
            return REFUSED, b"on there numba 0 and not 1"
        self.kept[node].add(request.contents)
        self.sent += [(node, content.digest) for content in request.contents]
        try:
            if request.modules is not None:
                self.kept[node].get(request.modules)
            function, args = unpack_call(request.payload, self.kept[node])
        except MissingError:
            return MISSING, b""
        return RETURNED, pickle.dumps(function(*args))

    def exclude(self, node: str, reason: str) -> None:
        del self.kept[node]
        self.unfit.discard(node)
        if not self.kept:
            raise RunStopped(f"none fits; {node}: {reason}")

    def stop(self, pool: str) -> None:
        self.stopped.append(pool)


def length(content: Shared, times: int) -> int:
    return len(content.content) * times


@pytest.mark.slow
def test_what_calls_share_travels_once_to_each_worker() -> None:
    carrier = Carrier({name: Kept() for name in "abc"})
    pool = RemotePool(carrier, LIMITS, shares_files=True)
    shared = [Shared.of(bytes(1000)), Shared.of(bytes(2000))]
    futures = [pool.submit(length, shared[n % 2], n) for n in range(40)]
    assert [future.result(0) for future in futures] == [1000 * (1 + n % 2) * n for n in range(40)]
    for content in shared:
        assert sorted(node for node, digest in carrier.sent if digest == content.digest) == [*"abc"]


@pytest.mark.slow
def test_a_worker_that_does_not_fit_is_left_out_and_the_last_one_ends_the_run() -> None:
    carrier = Carrier({name: Kept() for name in "abc"}, unfit={"a", "b"})
    pool = RemotePool(carrier, LIMITS, shares_files=True)
    assert [pool.submit(square, n).result(0) for n in range(5)] == [0, 1, 4, 9, 16]
    assert list(carrier.kept) == ["c"]
    carrier.unfit = {"c"}
    with pytest.raises(RunStopped, match=r"none fits; c: on there numba 0 and not 1"):
        pool.submit(square, 1).result(0)


@pytest.mark.slow
def test_a_worker_with_another_c_library_works_and_is_told_of_once(caplog: Log) -> None:
    pool = RemotePool(Carrier({"a": Kept(), "odd": Kept()}), LIMITS, shares_files=True)
    assert [pool.submit(square, n).result(0) for n in range(6)] == [0, 1, 4, 9, 16, 25]
    (line,) = [record.getMessage() for record in caplog.records]
    assert line.startswith("executor: the C library or the processor of odd differs")


@pytest.mark.slow
def test_closing_cancels_what_is_out_and_stops_the_workers() -> None:
    carrier = Carrier({"a": Kept()}, hold=True)
    pool = RemotePool(carrier, LIMITS, shares_files=True)
    future, cancelled = pool.submit(square, 2), pool.submit(square, 3)
    assert cancelled.cancel()
    pool.close()
    with pytest.raises(CancelledError):
        future.result(0)
    assert len(carrier.stopped) == 1
    with pytest.raises(RuntimeError, match="closed"):
        pool.submit(square, 2)
    with pytest.raises(InputError, match="cannot be sent"):
        RemotePool(carrier, LIMITS, shares_files=True).submit(lambda: None)


def test_a_process_keeps_the_newest_contents() -> None:
    kept, contents = Kept(), [Shared.of(bytes([n])) for n in range(KEPT + 3)]
    for content in contents:
        kept.add([content])
        assert kept.get(contents[0].digest).content == contents[0].content  # used, so not dropped
    for content in contents[1:4]:
        with pytest.raises(MissingError):
            kept.get(content.digest)
    for content in contents[4:]:
        assert kept.get(content.digest).content == content.content


# ---- modules


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: Patch) -> Path:
    """A folder of the user, from which a module and one of a package have been imported."""
    folder = tmp_path / "mine"
    files = {
        "own_part.py": "import own_package.inner\nVALUE = own_package.inner.read()\n",
        "own_other.py": "LATER = 7\n",
        "random.py": "raise SystemExit('the module of the standard library is meant')\n",
        "notes.txt": "not needed",
        "unused/big.py": "X = 1\n",
        "own_package/__init__.py": "",
        "own_package/table.csv": "42",
        "own_package/.hidden": "secret",
        "own_package/inner.py": "from pathlib import Path\n\ndef read():\n"
        "    return int(Path(__file__).with_name('table.csv').read_text())\n",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.setattr(sys, "path", [*sys.path, str(folder)])
    __import__("own_part")
    return folder


@pytest.mark.slow
def test_modules_of_the_user_travel_with_what_lies_beside_them(mine: Path, tmp_path: Path) -> None:
    archive = UserModules().pack()
    assert archive is not None
    folders = unpack_modules(archive.content, tmp_path / "there")
    unpacked = {str(f.relative_to(tmp_path / "there")) for f in (tmp_path / "there").rglob("*.*")}
    names = {name.partition("/")[2] for name in unpacked}
    assert {"own_part.py", "own_other.py", "own_package/table.csv"} <= names
    assert not names & {"random.py", "notes.txt", "unused/big.py", "own_package/.hidden"}
    script = "import own_part, own_other, random; print(own_part.VALUE, own_other.LATER)"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {folders!r}; {script}"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"},
        check=False,
    )
    assert (done.stdout, done.stderr) == ("42 7\n", "")


@pytest.mark.slow
def test_a_run_goes_on_with_the_code_that_it_began_with(mine: Path) -> None:
    known = UserModules()
    before = known.pack()
    (mine / "own_part.py").write_text("VALUE = 0\n")
    sys.modules["one_more"] = ModuleType("one_more")  # it looks for new ones
    assert known.pack() == before
    sys.modules["own_other"] = ModuleType("own_other")
    assert UserModules().pack() != before


@pytest.mark.slow
def test_a_folder_that_holds_more_than_modules_is_refused(mine: Path, monkeypatch: Patch) -> None:
    monkeypatch.setattr(companion, "MAX_BYTES", 1 << 20)
    (mine / "own_package" / "video.bin").write_bytes(bytes((1 << 20) + 1))
    with pytest.raises(
        InputError, match=r"the modules sent to workers exceed 1 MiB with "
    ) as refusal:
        UserModules().pack()
    assert "\n" not in str(refusal.value)


# ---- which workers fit


def test_an_equal_environment_has_no_differences_and_each_difference_is_named() -> None:
    here = dict(describe_environment())
    assert list_differences(here) == []
    for name, value in here.items():
        other = list_differences({**here, name: "other"})
        matters = bool(value) and name != LIBRARY
        assert other == ([f"{name} {value}, not other"] if matters else [])
        assert has_library({**here, name: "other"}) == (name != LIBRARY)
        if name in ("pybullet", "mujoco-core"):
            assert list_differences({**here, name: ""}) == []


def test_the_digest_of_arithmetic_includes_the_tails_of_the_generator() -> None:
    normal, exponential = draw_deviates()
    assert sum(abs(normal) > _constants.ziggurat_nor_r) > 1
    assert sum(exponential > _constants.ziggurat_exp_r) > 1


@pytest.mark.parametrize(
    "name", ["evoros.base.ziggurat.log1p", "evoros.plugins.clusters.node.UNARY"]
)
def test_another_function_of_evoros_is_another_arithmetic(name: str, monkeypatch: Patch) -> None:
    before = describe_environment()[ARITHMETIC]
    monkeypatch.setattr(name, nearly_log1p if name.endswith("log1p") else (nearly_log1p,))
    describe_environment.cache_clear()
    try:
        assert describe_environment()[ARITHMETIC] != before
    finally:
        describe_environment.cache_clear()


def nearly_log1p(x: float) -> float:
    return math.nextafter(math.log1p(x), math.inf)


def test_the_environment_of_another_process_is_the_same() -> None:
    assert read_environment({}) == dict(describe_environment())


@pytest.mark.skipif(
    "fma" not in Path("/proc/cpuinfo").read_text().split(), reason="there are no paths to choose"
)
def test_on_an_older_processor_only_the_c_library_differs() -> None:
    """There, it takes other code paths, with other last digits; evoros's functions do not."""
    older = read_environment({"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"})
    here = dict(describe_environment())
    assert {name for name in here if here[name] != older[name]} == {LIBRARY}


def read_environment(variables: dict[str, str]) -> dict[str, str]:
    script = (
        "import json; from evoros.plugins.clusters.node import describe_environment as d; "
        "print(json.dumps(dict(d())))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        env={**os.environ, **variables},
        check=True,
    )
    described: dict[str, str] = json.loads(done.stdout)
    return described
