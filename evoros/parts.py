"""The interface for authors of parts: base classes, values, field rules and array indices.

    from evoros.parts import COUNT, Channels, Fault, Generator, checked

``docs/extending.md`` has an example of each kind of part. Import ``Design``, ``Mount`` and
``InputError`` from ``evoros``. evoros itself never imports this module.
"""

# fmt: off
# isort: off
from numpy.random import Generator
from evoros.allocation.protocol import Allocation, Standing
from evoros.base import elementary
from evoros.base.arrays import (
    CONTACT, DRIVE_SPEED, FROM_X, FROM_Y, LEFT_WHEELS, RIGHT_WHEELS, SPEED, STEERING, TO_X, TO_Y,
    YAW, YAW_RATE, Array, Matrix, X, Y, product,
)
from evoros.base.checks import (
    COUNT, FLAG, INTERVAL, NOT_NEGATIVE, NUMBER, POSITIVE, PROBABILITY, TEXT, WHOLE, Interval, Rule,
    bounds, check_order, checked, instance_of, invalid, mapping_of, one_of, sequence_of,
)
from evoros.base.compilable import compilable
from evoros.base.errors import LaunchError, PilotLost, SimulationError, WorkerLost
from evoros.bridge.process import OutsideProcess, start_process
from evoros.compilation.named_rules import Started
from evoros.controller.protocol import (
    Briefing, Controller, Estimator, EvolvedValue, Layer, LiveController, Pilot, StartedLayer,
)
from evoros.design.protocol import Area, BoundRegion, RegionDescription, SensorPose
from evoros.drive.ackermann import Ackermann, AckermannDescription
from evoros.drive.protocol import Drive, DriveDescription
from evoros.executor.protocol import Executor, Pool
from evoros.failure.onset.protocol import AN_ONSET, Onset
from evoros.failure.protocol import (
    AdaptiveFailure, Adversary, Case, Failure, Fault, SystematicFailure, Trigger,
)
from evoros.filter.protocol import (
    A_FILTER, ALTERS, COMMAND, DRIVE, ENDS, FILTERS, GROWS, POSE, READINGS, STRENGTH, Channels,
    Filter, add_within,
)
from evoros.filter.silence import Silence
from evoros.filter.stuck import Stuck
from evoros.fitness.protocol import AdditiveFitness, CombiningFitness, Fitness
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import Footprint, project_bodies
from evoros.measure.protocol import Evaluated, Measure
from evoros.mission.mission import Outcome
from evoros.observers.protocol import ObservedEnd, ObservedGeneration, ObservedRun, Observer, Send
from evoros.optimizer.protocol import (
    Candidate, CoveringSpace, Goals, Individual, Optimizer, Score, Search, Space, View,
    check_scores,
)
from evoros.robot.model import Robot
from evoros.sensor.protocol import CONTACT as CONTACT_SIGNAL
from evoros.sensor.protocol import (
    MOTION, RANGE, WHEELS, Channel, ContactSensor, RangeSensor, Sensor, SignalSensor, sees,
)
from evoros.simulator.protocol import PlacedRobot, Simulation, Simulator
from evoros.world.course import Course
from evoros.world.model import World

__all__ = [  # noqa: RUF022 - grouped by topic
    # Fields and their rules.
    "checked", "check_order", "invalid", "Rule", "NUMBER", "POSITIVE", "NOT_NEGATIVE",
    "PROBABILITY", "COUNT", "WHOLE", "FLAG", "TEXT", "INTERVAL", "A_FILTER", "FILTERS", "one_of",
    "instance_of", "sequence_of", "mapping_of", "Interval", "bounds",
    # Arrays, their indices, and compiled rules.
    "Array", "Matrix", "Started", "X", "Y", "YAW", "SPEED", "YAW_RATE", "CONTACT",
    "FROM_X", "FROM_Y", "TO_X", "TO_Y", "DRIVE_SPEED", "STEERING", "LEFT_WHEELS", "RIGHT_WHEELS",
    "compilable",
    # Functions with bit-identical results on all processors.
    "elementary", "product",
    # Robots, drives and worlds.
    "Robot", "Urdf", "Drive", "DriveDescription",
    "Ackermann", "AckermannDescription", "World", "Course",
    # Sensors and their regions.
    "Sensor", "RangeSensor", "SignalSensor", "ContactSensor", "Channel", "RANGE", "MOTION",
    "WHEELS", "CONTACT_SIGNAL", "sees", "RegionDescription", "BoundRegion", "Area", "SensorPose",
    # Filters and failures.
    "Filter", "Channels", "ENDS", "ALTERS", "GROWS", "add_within", "Silence", "Stuck", "Generator",
    "Failure", "Fault", "SystematicFailure", "AdaptiveFailure", "Adversary", "Case",
    "Trigger", "Onset", "AN_ONSET", "READINGS", "POSE", "COMMAND", "DRIVE",
    "STRENGTH",
    # Controllers.
    "Controller", "Layer", "Estimator", "StartedLayer", "EvolvedValue", "LiveController",
    "Briefing", "Pilot", "start_process", "OutsideProcess",
    # Simulators.
    "Simulator", "PlacedRobot", "Simulation", "project_bodies", "Footprint", "compute_clearances",
    # Searches, measures and allocations of trials.
    "Optimizer", "Search", "Space", "CoveringSpace", "View", "Goals", "Individual", "Candidate",
    "Score", "check_scores",
    "Measure", "Evaluated", "Allocation", "Standing",
    # Fitness functions, executors and observers.
    "Fitness", "AdditiveFitness", "CombiningFitness", "Outcome", "Executor", "Pool",
    "Observer", "Send", "ObservedRun", "ObservedGeneration", "ObservedEnd",
    # Errors that parts may raise.
    "SimulationError", "WorkerLost", "PilotLost", "LaunchError",
]
# fmt: on
