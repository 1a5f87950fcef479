"""Rigid-body physics in Gazebo's library."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "physics in Gazebo's library")
