"""A call on its way to the workers of a dask cluster."""

import asyncio
from dataclasses import dataclass
from typing import Any

from distributed import get_worker

from evoros.executor import node
from evoros.executor.remote import RawAnswer


def answer(wanted: dict[str, str], request: bytes) -> RawAnswer:
    """Run a call in a worker; see ``node.answer``."""
    return (*node.answer(wanted, request), get_worker().address)


@dataclass(eq=False)
class Sending:
    """A call that is on its way, to certain workers or to any."""

    name: str
    wanted: dict[str, str]
    request: bytes
    nodes: list[str] | None
    waiting: asyncio.Future[Any] | None = None
    stranded: bool = False

    async def attempt(self, client: Any) -> RawAnswer:
        """Submit the call and wait for its answer."""
        task = client.submit(
            answer,
            self.wanted,
            self.request,
            pure=False,
            workers=self.nodes,
            allow_other_workers=self.nodes is not None,
        )
        self.waiting = asyncio.ensure_future(client.gather(task, asynchronous=True))
        returned: RawAnswer = await self.waiting
        return returned

    def cancel(self) -> None:
        """Stop waiting."""
        if self.waiting is not None:
            self.waiting.cancel()
