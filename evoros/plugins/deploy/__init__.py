"""Prepares a champion for the real robot: a ROS 2 package, ArduPilot parameters, a drawing."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(
    __name__,
    "a champion as a package for the robot",
    figures={"deploy": f"{__name__}.subcommand"},
    exports=frozenset({"deploy"}),
)
