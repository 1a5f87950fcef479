"""Conformance tests for executors."""

from evoros.executor.protocol import Executor
from evoros.testing.part import DescriptionSuite


class ExecutorSuite(DescriptionSuite):
    """Conformance tests for an executor, with functions that every worker can import."""

    part: Executor
    protocol = Executor

    def test_calls_give_what_plain_calls_give(self) -> None:
        """Results and errors are as in direct calls, and the pool states its number of workers."""
        with self.part.open() as pool:
            assert pool.workers >= 1, f"workers must be at least 1, not {pool.workers}"
            assert isinstance(pool.shares_files, bool), "shares_files must be True or False"
            futures = [pool.submit(pow, n, 2) for n in range(40)]
            assert [future.result() for future in futures] == [n * n for n in range(40)]
            error = pool.submit(divmod, 1, 0).exception()
            assert isinstance(error, ZeroDivisionError), f"the future must not raise {error!r}"
            assert pool.submit(pow, 7, 2).result() == 49, "the pool must continue after an error"
