"""The main-process side of a worker pool on other machines; ``node`` is the worker side."""

import pickle
import uuid
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, Protocol

from evoros.base.errors import EvorosError
from evoros.executor.protocol import MISSING, Answer, Call, Shared, pack_call
from evoros.executor.worker_handle import Limits, settle
from evoros.plugins.clusters.companion import Request, UserModules
from evoros.plugins.clusters.node import REFUSED, describe_environment
from evoros.terminal.log import LOGGER

RawAnswer = tuple[int, bytes, bool, str]  # result of ``node.answer``, and the name of the worker


class Transport(Protocol):
    """Sends requests to workers."""

    @property
    def workers(self) -> int:
        """The number of calls that the workers can run simultaneously."""

    def send(
        self, name: str, wanted: dict[str, str], request: bytes, node: str | None
    ) -> "Future[RawAnswer]":
        """Run ``clusters.node.answer(wanted, request)``, preferably in the worker named ``node``.

        The future raises WorkerLost if the call ``name`` loses its worker repeatedly, and
        RunStopped if the workers can no longer be reached.
        """

    def exclude(self, node: str, reason: str) -> None:
        """Stop sending calls to a worker, and log why; raise RunStopped if it was the last."""

    def stop(self, pool: str) -> None:
        """Make the workers end the calls of a pool."""


@dataclass(frozen=True, eq=False)
class _Sent:
    call: Call
    modules: Shared | None
    future: "Future[Any]" = field(default_factory=Future)


class RemotePool:
    """A pool that sends calls through a transport, and resends calls that have not started."""

    def __init__(self, transport: Transport, limits: Limits, shares_files: bool) -> None:
        self.shares_files = shares_files
        self._transport, self._limits = transport, limits
        self._name = uuid.uuid4().hex
        self._wanted = dict(describe_environment())
        self._modules = UserModules()
        self._lock = Lock()
        self._out: set[_Sent] = set()
        self._warned: set[str] = set()  # workers with a different C library that have been reported
        self._closed = False

    @property
    def workers(self) -> int:
        """The number of calls that can run simultaneously."""
        return self._transport.workers

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Send a call to a worker; see ``Pool``."""
        sent = _Sent(pack_call(function, args), self._modules.pack())
        with self._lock:
            if self._closed:
                raise RuntimeError("this pool is closed")
            self._out.add(sent)
        self._send(sent, (), None)
        return sent.future

    def close(self) -> None:
        """End all calls; their futures raise CancelledError."""
        with self._lock:
            self._closed = True
            out, self._out = self._out, set()
        for sent in out:
            if sent.future.cancel():
                sent.future.set_running_or_notify_cancel()
        self._transport.stop(self._name)

    def _send(self, sent: _Sent, contents: tuple[Shared, ...], node: str | None) -> None:
        call, modules = sent.call, sent.modules
        archive = None if modules is None else modules.digest
        sent_call = call.name, call.payload, tuple(shared.digest for shared in call.shared)
        request = Request(self._name, self._limits, archive, *sent_call, contents)
        try:
            raw = self._transport.send(call.name, self._wanted, pickle.dumps(request), node)
        except EvorosError as error:
            self._finish(sent, error)
            return
        sent.future.add_done_callback(lambda done: raw.cancel() if done.cancelled() else None)
        raw.add_done_callback(lambda done: self._receive(sent, done))

    def _receive(self, sent: _Sent, raw: "Future[RawAnswer]") -> None:
        error = CancelledError() if raw.cancelled() else raw.exception()
        if error is not None:
            self._finish(sent, error)
            return
        kind, content, same_library, node = raw.result()
        if not same_library:
            self._warn(node)
        if kind == MISSING:
            modules = () if sent.modules is None else (sent.modules,)
            self._send(sent, (*sent.call.shared, *modules), node)
        elif kind == REFUSED:
            fix = "install the versions of the main process on that machine"
            try:
                self._transport.exclude(node, f"{content.decode()}; {fix}")
            except EvorosError as problem:
                self._finish(sent, problem)
            else:
                self._send(sent, (), None)
        else:
            self._finish(sent, Answer(kind, content))

    def _warn(self, node: str) -> None:
        with self._lock:
            if node in self._warned:
                return
            self._warned.add(node)
        LOGGER.warning(
            "executor: the C library or the processor of %s differs; there, the last digits of "
            "results may differ in missions with a physics engine or with your own parts that use "
            "the module math",
            node,
        )

    def _finish(self, sent: _Sent, end: Answer | BaseException) -> None:
        with self._lock:
            if sent not in self._out:
                return
            self._out.remove(sent)
        if not sent.future.set_running_or_notify_cancel():
            return
        if isinstance(end, Answer):
            settle(sent.future, end)
        else:
            sent.future.set_exception(end)
