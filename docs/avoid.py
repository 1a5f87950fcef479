"""Drives to the waypoint, and turns away from what is near."""

import json
import math
import os

NO_DECISION, AVOIDING, NAVIGATING = 0, 1, 2  # controller.modes=[avoiding,navigating]

lines = os.fdopen(int(os.environ["EVOROS_IN"]), "r")
answers = os.fdopen(int(os.environ["EVOROS_OUT"]), "w", buffering=1)  # sends each line at once

mission = json.loads(lines.readline())
top_speed = mission["drive"]["max_speed_mps"]
full_lock = mission["drive"]["steering_limit_rad"]
near = mission["parameters"]["near_m"]
yaws = [sensor["pose"][3] for sensor in mission["sensors"]]
print('{"ready": true}', file=answers)

for line in lines:
    time, (x, y, yaw, *_), (_, _, to_x, to_y), readings = json.loads(line)
    turn = 0.0  # for each sensor that sees something near, away from its side
    for side, reading in zip(yaws, readings, strict=True):
        if reading is not None and reading < near:
            turn += -1.0 if side > 0.0 else 1.0
    if turn != 0.0:
        mode, steering = AVOIDING, math.copysign(full_lock, turn)
    elif None in (x, y, yaw):  # a silent localization
        mode, steering = NO_DECISION, 0.0
    else:
        error = math.remainder(math.atan2(to_y - y, to_x - x) - yaw, 2.0 * math.pi)
        mode, steering = NAVIGATING, min(max(error, -full_lock), full_lock)
    print(json.dumps([mode, top_speed, steering]), file=answers)
