"""A right part of each kind in one module, and the methods that a fault may be put into."""

from pathlib import Path
from typing import NamedTuple

RIGHT = """
import math
from contextlib import nullcontext
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evoros import parts
from evoros.certificate.confirmation import Confirmation
from evoros.certificate.final_choice import FinalChoice
from evoros.fitness.equation_one import EquationOne
from evoros.measure.mass import Mass
from evoros.parts import ALTERS, RANGE, WHEELS, Channel, StartedLayer


class P(NamedTuple):
    a: float = 1.0


class Noise(parts.Filter):
    name, effect = "mine", ALTERS

    def start(self, channels, onset, rng):
        return P()

    @staticmethod
    def rule(values):
        pass


class Body:
    period_s, size_m, mass_kg, price, filters = 0.1, (0.02, 0.02, 0.02), 0.005, 1.0, {}

    def gazebo(self, name):
        return ""


class Laser(Body, parts.RangeSensor):
    measures, range_min_m, range_max_m = RANGE, 0.1, 4.0
    channels = (Channel("range", "m", 0.1, 4.0),)

    def rays(self):
        return np.array([[1.0, 0.0, 0.0]])

    def channel_of(self):
        return np.array([0])


class Meter(Body, parts.SignalSensor):
    measures = WHEELS
    channels = (Channel("trip", "m", -1.0, 1.0),)

    def start(self):
        return P()

    @staticmethod
    def rule(values):
        values[0] = 0.0


class Layer(parts.Layer):
    mode = "navigating"

    def __init__(self, **settings):
        pass

    def start(self, robot, period, rng):
        return P()

    @staticmethod
    def rule(command):
        command[0] = 0.3
        return True


class Controlled:
    period_s, localization, modes = 0.1, {}, ("navigating",)


class Layered(Controlled, parts.Controller):
    def open(self, robot, rng):
        return nullcontext([StartedLayer(Layer.rule, P())])


class Live(Controlled, parts.LiveController):
    files = ()

    def launch(self, briefing):
        return nullcontext(self)

    def exchange(self, time, state, leg, readings, command):
        command[0] = 0.3
        return 1


class Estimator(parts.Estimator):
    def start_estimate(self, robot, period):
        return P()

    @staticmethod
    def rule(pose):
        pass


class Tracker(parts.Observer):
    def check(self):
        pass

    def open(self, run):
        return nullcontext(lambda run: None)
"""

NUMBERS = ("pass", "return 'x'", "return math.nan", "1 / 0", "return np.zeros(7)")
OBJECTS = (*NUMBERS, "return 1e308")
TEXTS = ("pass", "return 1e308", "1 / 0", "return np.zeros(7)")
ENTERED = (*OBJECTS, "return nullcontext(None)")
STARTS = OBJECTS[1:]  # a rule may have neither parameters nor memory
VALUES = ("values[0] = 'x'", "1 / 0", "values[99] = 1")
TRUTHS = (*OBJECTS, "return True")
COMMANDS = ("command[0] = math.nan; return 1", "command[0] = 1e308; return 1")


class Kind(NamedTuple):
    """The class with a fault in one method, its place in the configuration, and the faults."""

    base: str
    overrides: tuple[str, ...]
    faults: dict[str, tuple[str, ...]]  # bodies by the head of the method
    mended: bool = False  # whether a stopped run takes the corrected part


def _properties(*names: str, faults: tuple[str, ...] = OBJECTS) -> dict[str, tuple[str, ...]]:
    return {f"@property\n    def {name}(self)": faults for name in names}


def _static(head: str, faults: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    return {f"@staticmethod\n    def {head}": faults}


_BODY = _properties("period_s", "mass_kg", "price", faults=NUMBERS)
_BODY |= _properties("size_m", "filters", "channels")
_CONTROLLED = _properties("period_s", faults=NUMBERS) | _properties("modes", "localization")
_OWN = ("controller=own",)
_MEASURE = ("optimizer=nsga2", "optimizer.population_size=4", "+measure@objectives.mine=mass")
_CONFIRMING = "+confirmation.simulator={_target_:evoros.simulator.planar.Planar}"

KINDS = {
    "filter": Kind(
        "Noise",
        ("+design.sensors.sonar.filters.mine._target_={}",),
        {
            "def start(self, *_)": STARTS,
            **_properties("effect"),
            **_properties("name", faults=TEXTS),
            **_static("rule(values)", VALUES),
        },
    ),
    "sensor": Kind(
        "Laser",
        ("+design.sensors.mine._target_={}",),
        {
            "def rays(self)": OBJECTS,
            "def channel_of(self)": OBJECTS,
            "def gazebo(self, name)": TEXTS,
            **_BODY,
        },
    ),
    "signal sensor": Kind(
        "Meter",
        ("+design.sensors.mine._target_={}",),
        {"def start(self)": STARTS, **_static("rule(values)", VALUES)},
    ),
    "layer": Kind(
        "Layer",
        ("controller.navigation._target_={}",),
        {
            "def start(self, *_)": STARTS,
            **_static("rule(command)", ("pass", "1 / 0", "command[5] = 1", *COMMANDS)),
        },
    ),
    "controller": Kind("Layered", _OWN, {"def open(self, *_)": ENTERED, **_CONTROLLED}),
    "live controller": Kind(
        "Live",
        _OWN,
        {
            "def launch(self, briefing)": ENTERED,
            "def exchange(self, time, state, leg, readings, command)": (*TRUTHS, *COMMANDS),
            **_properties("files"),
            **_CONTROLLED,
        },
    ),
    "localization": Kind(
        "Estimator",
        ("+controller.localization.mine._target_={}",),
        {
            "def start_estimate(self, *_)": STARTS,
            **_static("rule(pose)", ("pose[0] = 'x'", "1 / 0", "pose[9] = 1")),
        },
    ),
    "fitness": Kind("EquationOne", ("fitness._target_={}",), {"def score(self, _)": TRUTHS}, True),
    "measure": Kind(
        "Mass",
        (*_MEASURE, "objectives.mine._target_={}"),
        {"def compute(self, _)": ("pass", "return 'x'", "1 / 0", "return True")},
    ),
    "confirmation": Kind(
        "Confirmation",
        ("+confirmation._target_={}", _CONFIRMING),
        {"def confirm_best(self, *_)": (*OBJECTS, "return {99: 1.0}", "return {False: 1.0}")},
    ),
    "final choice": Kind(
        "FinalChoice",
        ("final_choice=halving", "final_choice._target_={}"),
        {"def find_finalists(self, _)": (*OBJECTS, "return [99]", "return [False]")},
        True,
    ),
    "observer": Kind("Tracker", ("+observers.mine._target_={}",), {"def open(self, run)": ENTERED}),
}


def write_part(folder: Path, kind: Kind, method: str = "") -> list[str]:
    """Write the module ``own`` with a right part, or one with this method; return its overrides."""
    code = method or "pass"
    module = f"own_{folder.name}"
    (folder / "controller").mkdir(parents=True, exist_ok=True)
    (folder / "controller" / "own.yaml").write_text(f"_target_: {module}.Own\n")
    (folder / f"{module}.py").write_text(f"{RIGHT}\n\nclass Own({kind.base}):\n    {code}\n")
    return [word.replace("{}", f"{module}.Own") for word in kind.overrides]
