"""The ArduPilot Rover firmware as a controller, in lock-step with the mission."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "ArduPilot as the controller", extras=("ardupilot",))
