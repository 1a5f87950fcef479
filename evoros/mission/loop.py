"""The mission loop (observe, sense, filter, decide, advance) in compilable form."""

import math

from evoros.base.arrays import (
    COMMAND_SIZE,
    CONTACT,
    DRIVE_SPEED,
    FROM_X,
    FROM_Y,
    LEG_SIZE,
    SPEED,
    STATE_SIZE,
    STEERING,
    TO_X,
    TO_Y,
    YAW,
    Array,
    X,
    Y,
    copy_values,
)
from evoros.base.compilable import compilable
from evoros.mission.inputs import (
    COLLISION,
    COLLISIONS,
    COMPLETED,
    DECIDED,
    END_ROW,
    END_TICK,
    ENDED,
    FIRST_COLLISION,
    RUNNING,
    TIME_LIMIT,
    TOUCHING,
    VISITED,
    Agents,
    Arrays,
    FilterStage,
    LayerStage,
    LoopInputs,
    LoopResult,
    Timing,
    get_stage,
)
from evoros.mission.triggers import update_clocks


def run_loop(inputs: LoopInputs, agents: Agents, timing: Timing, arrays: Arrays) -> LoopResult:
    """Run a mission, or the ticks that ``timing`` specifies."""
    # One long function, because compiled code would copy rules passed to another function.
    observe, sense, advance = inputs.observe, inputs.sense, inputs.advance
    parameters, memory, layers = inputs.parameters, inputs.memory, inputs.layers
    filters, localization, actuation = inputs.filters, inputs.localization, inputs.actuation
    tick, record_every, limit, first_tick, last_tick, rows = timing
    states, poses, legs, commands = arrays.states, arrays.poses, arrays.legs, arrays.commands
    signals, readings, decisions = arrays.signals, arrays.readings, arrays.decisions
    ended, decided, clocks = arrays.counts[ENDED], arrays.counts[DECIDED], arrays.clocks
    for k in range(first_tick, last_tick + 1):
        time = k * tick
        if k > 0:
            advance(parameters, memory, arrays.driven, tick)
        observe(parameters, memory, states)
        awaited, ending, due = False, False, False
        for i in range(inputs.robots):
            if ended[i] != RUNNING:
                continue
            if not update_agent(agents, arrays, i, k, rows, k == limit):
                return LoopResult(k, rows, False)
            if ended[i] != RUNNING:
                ending = True
            else:
                awaited = awaited or agents.awaited[i]
                due = due or k % agents.sense_every[i] == 0
        update_clocks(clocks, arrays.triggers, arrays.counts[VISITED], states, legs, time)
        if awaited and due:
            sense(parameters, memory, signals)
            for place in range(len(filters)):
                stage = get_stage(FilterStage, filters, place)
                every, change, constants, kept, rng, source, values, i, clock = stage
                if k % every == 0 and ended[i] == RUNNING:
                    change(constants, kept, rng, source, values, clocks[clock])
        for i in range(inputs.robots):
            if not awaited or ended[i] != RUNNING or k % agents.decide_every[i] != 0:
                continue
            pose = poses[i * STATE_SIZE : (i + 1) * STATE_SIZE]
            copy_values(states[i * STATE_SIZE : (i + 1) * STATE_SIZE], pose)
            for place in range(len(localization)):
                stage = get_stage(FilterStage, localization, place)
                _, change, constants, kept, rng, source, values, j, clock = stage
                if j == i:
                    change(constants, kept, rng, source, values, clocks[clock])
            leg = legs[i * LEG_SIZE : (i + 1) * LEG_SIZE]
            seen = readings[agents.readings[i] : agents.readings[i + 1]]
            command = commands[i * COMMAND_SIZE : (i + 1) * COMMAND_SIZE]
            mode, first = 0, agents.layers[i]
            for place in range(first, agents.layers[i + 1]):
                decide, constants, kept = get_stage(LayerStage, layers, place)
                if decide(constants, kept, pose, leg, seen, time, command):
                    mode = place - first + 1
                    break
            decisions[first + i + mode] += 1.0
            decided[i] = mode
            for place in range(len(actuation)):
                stage = get_stage(FilterStage, actuation, place)
                _, change, constants, kept, rng, source, values, j, clock = stage
                if j == i:
                    change(constants, kept, rng, source, values, clocks[clock])
        if k % record_every == 0 or ending or not awaited:
            record(agents, arrays, time, arrays.trajectory[rows])
            rows += 1
        if not awaited:
            break
    return LoopResult(k, rows, True)


@compilable
def update_agent(agents: Agents, arrays: Arrays, i: int, k: int, row: int, last: bool) -> bool:
    """Count waypoints and contacts of robot ``i`` at tick ``k``; return False for a bad state."""
    states, legs, counts = arrays.states, arrays.legs, arrays.counts
    at, leg = i * STATE_SIZE, i * LEG_SIZE
    # Arithmetic on Python floats is several times as fast as on numpy scalars.
    x, y = float(states[at + X]), float(states[at + Y])
    if not math.isfinite(x + y + float(states[at + YAW]) + float(states[at + SPEED])):
        return False
    goal_x, goal_y = float(legs[leg + TO_X]), float(legs[leg + TO_Y])
    ended, reach = RUNNING, agents.acceptance[i]
    if (goal_x - x) * (goal_x - x) + (goal_y - y) * (goal_y - y) <= reach * reach:
        counts[VISITED, i] += 1.0
        next_goal = agents.routes[i] + int(counts[VISITED, i])
        if next_goal == agents.routes[i + 1]:
            ended = COMPLETED
        else:
            legs[leg + FROM_X], legs[leg + FROM_Y] = goal_x, goal_y
            legs[leg + TO_X] = arrays.routes[next_goal, 0]
            legs[leg + TO_Y] = arrays.routes[next_goal, 1]
    contact = float(states[at + CONTACT]) > 0.0
    if contact and counts[TOUCHING, i] == 0.0:
        counts[COLLISIONS, i] += 1.0
        if counts[FIRST_COLLISION, i] < 0.0:
            counts[FIRST_COLLISION, i] = k
        if agents.end_on_collision[i] and ended == RUNNING:
            ended = COLLISION
    counts[TOUCHING, i] = 1.0 if contact else 0.0
    if last and ended == RUNNING:
        ended = TIME_LIMIT
    if ended != RUNNING:
        arrays.driven[i * COMMAND_SIZE + DRIVE_SPEED] = 0.0
        counts[ENDED, i], counts[END_TICK, i], counts[END_ROW, i] = ended, k, row
    return True


@compilable
def record(agents: Agents, arrays: Arrays, time: float, row: Array) -> None:
    """Write a trajectory row: the time, each robot's columns, and the walkers' reports."""
    states, counts = arrays.states, arrays.counts
    row[0], start = time, 1
    for i in range(len(agents.awaited)):
        at = i * STATE_SIZE
        row[start], row[start + 1] = states[at + X], states[at + Y]
        row[start + 2], row[start + 3] = states[at + YAW], states[at + SPEED]
        row[start + 4] = arrays.driven[i * COMMAND_SIZE + STEERING]
        row[start + 5] = counts[DECIDED, i]
        row[start + 6] = counts[VISITED, i]
        row[start + 7] = counts[TOUCHING, i]
        start += 8
        count = agents.readings[i + 1] - agents.readings[i]
        copy_values(arrays.readings[agents.readings[i] :], row[start : start + count])
        start += count
        count = agents.estimates[i + 1] - agents.estimates[i]
        copy_values(arrays.poses[at:], row[start : start + count])
        start += count
    copy_values(states[len(agents.awaited) * STATE_SIZE :], row[start:])
