"""The run whose champion the tests of the package and of the plan share."""

import pytest
from helpers import tiny

from evoros.analysis.tables.records import Record, read_record
from evoros.terminal.console import DONE

GENE = "{_target_: evoros.design.genes.Gene, key: controller.avoidance.range_m, low: 1, high: 2}"


@pytest.fixture(scope="session")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    folder = tmp_path_factory.mktemp("deploy") / "run"
    assert tiny(folder, f"+design.genes.near={GENE}") == DONE
    return read_record(folder, "run")
