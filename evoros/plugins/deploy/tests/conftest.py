"""The run whose champion the tests of the package and of the plan share."""

import pytest
from helpers import finished_run

from evoros.analysis.tables.records import Record, read_record

GENE = "{_target_: evoros.design.genes.Gene, key: controller.avoidance.range_m, low: 1, high: 2}"


@pytest.fixture(scope="session")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return read_record(
        finished_run(tmp_path_factory.mktemp("deploy") / "run", f"+design.genes.near={GENE}"), "run"
    )
