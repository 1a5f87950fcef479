"""Values that are probably in another unit, and more workers than cores, are told."""

from dataclasses import replace

import pytest

from evoros.config.compose import compose
from evoros.executor.processes import Processes
from evoros.preflight import preflight
from evoros.preflight.preflight import check_units, check_workers

PLANE = ("simulator=planar", "executor=serial", "world=maze")


@pytest.mark.parametrize(
    ("usual", "mistaken", "meant"),
    [
        ("course.home_yaw_rad=-6.2", "course.home_yaw_rad=-90", "set it to -1.571 in radians"),
        (
            "design.sensors.sonar.range_max_m=999",
            "design.sensors.sonar.range_max_m=6000",
            "set it to 6 in metres",
        ),
    ],
)
def test_a_value_in_another_unit_is_told_with_the_value_in_the_right_one(
    usual: str, mistaken: str, meant: str
) -> None:
    assert list(check_units(compose([*PLANE, usual]).build())) == []
    (warning,) = check_units(compose([*PLANE, mistaken]).build())
    assert mistaken.rpartition("=")[0].rpartition(".")[2] in warning
    assert warning.endswith(meant)


def test_only_many_more_workers_than_cores_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preflight, "available_cores", lambda: 2)
    experiment = compose(PLANE).build()
    for workers in (0, 1, 8):
        assert list(check_workers(replace(experiment, executor=Processes(workers=workers)))) == []
    (warning,) = check_workers(replace(experiment, executor=Processes(workers=9)))
    assert warning.startswith("executor.workers: 9 workers share 2 cores")
