"""The rules that are compiled while evoros is installed are those of the bundled parts."""

import re
from pathlib import Path
from typing import Any

import pytest

from evoros.compilation import machine_code
from evoros.compilation.named_rules import NamedRule
from evoros.controller import neural
from evoros.controller.protocol import ESTIMATOR_ARGUMENTS, LAYER_ARGUMENTS, Estimator, Layer
from evoros.filter.protocol import FILTER_ARGUMENTS, Filter, Held
from evoros.filter.stuck import Stuck
from evoros.mission.bundled_rules import list_part_rules
from evoros.sensor.bumper import Bumper
from evoros.sensor.protocol import SENSOR_ARGUMENTS, SignalSensor


def test_a_rule_has_the_arguments_and_types_with_which_missions_bind_it() -> None:
    rules = list(list_part_rules())
    assert NamedRule(Stuck.rule, FILTER_ARGUMENTS, Stuck.Parameters, Held) in rules
    assert NamedRule(Bumper.rule, SENSOR_ARGUMENTS, memory=Bumper.Memory) in rules
    for function in (neural.avoid, neural.command_from):
        assert NamedRule(function, LAYER_ARGUMENTS, neural.Parameters, neural.Memory) in rules


@pytest.mark.parametrize(
    ("base", "arguments"),
    [
        (Filter, FILTER_ARGUMENTS),
        (SignalSensor, SENSOR_ARGUMENTS),
        (Estimator, ESTIMATOR_ARGUMENTS),
        (Layer, LAYER_ARGUMENTS),
    ],
)
def test_no_part_is_missing(base: type, arguments: tuple[str, ...]) -> None:
    listed = {rule.function for rule in list_part_rules() if rule.arguments == arguments}
    kinds: list[Any] = base.__subclasses__()
    bundled = [kind for kind in kinds if re.match(r"evoros\.(?!plugins)", kind.__module__)]
    rules = {kind.rule for kind in bundled if hasattr(kind, "rule")}
    assert rules
    assert rules <= listed


def test_code_of_the_installation_is_copied_and_newer_code_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, folder = tmp_path / "package", tmp_path / "cache" / "0123"
    for name in ("0123/a/kept.1.nbc", "0123/a/new.nbi", "4567/a/other.nbi"):
        file = package / machine_code.BUNDLED / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"installed")
    (folder / "a").mkdir(parents=True)
    (folder / "a" / "kept.1.nbc").write_bytes(b"compiled")
    monkeypatch.setattr(machine_code, "PACKAGE", package)
    machine_code._copy_bundled(folder)
    copied = {file.name: file.read_bytes() for file in folder.rglob("*.nb?")}
    assert copied == {"kept.1.nbc": b"compiled", "new.nbi": b"installed"}
