"""A real ArduPilot Rover, simulated in lock-step, as the controller."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "ArduPilot as the controller", extras=("ardupilot",))
