"""The rover's own two layers, outside: they get what the layers inside get."""

import json
import math
import os
from types import SimpleNamespace
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.compilation.named_rules import bind
from evoros.controller.l1 import L1
from evoros.controller.protocol import LAYER_ARGUMENTS
from evoros.controller.weighted_voting import WeightedVoting
from evoros.sensor.protocol import RANGE


def to_array(values: list[float | None]) -> Array:
    """NaN where something is silent."""
    return np.array([math.nan if value is None else value for value in values])


lines = os.fdopen(int(os.environ["EVOROS_IN"]))
answers = os.fdopen(int(os.environ["EVOROS_OUT"]), "w", buffering=1)
mission = json.loads(lines.readline())
drive, sensors = mission["drive"], mission["sensors"]
robot: Any = SimpleNamespace(
    drive=SimpleNamespace(
        steering_limit=drive["steering_limit_rad"], rear_axle_x_m=drive["rear_axle_x_m"]
    ),
    mounted_sensors=lambda: [
        SimpleNamespace(measures=RANGE, range_max_m=each["range_max_m"]) for each in sensors
    ],
    channel_yaws=lambda: [each["pose"][3] for each in sensors],  # each has one channel
    channel_count=len(sensors),
    layout=[slice(number, number + 1) for number in range(len(sensors))],
)
rng = np.random.default_rng(mission["seed"])
layers = [
    bind(layer.rule, LAYER_ARGUMENTS, layer.start(robot, mission["period_s"], rng))
    for layer in (WeightedVoting(), L1())
]
command = np.zeros(2)
answers.write('{"ready": true}\n')
for line in lines:
    time, state, leg, readings = json.loads(line)
    state, leg, readings = map(to_array, (state, leg, readings))
    mode = 0
    for number, decide in enumerate(layers, 1):
        if decide(state, leg, readings, time, command):
            mode = number
            break
    answers.write(json.dumps([mode, *command.tolist()]) + "\n")
