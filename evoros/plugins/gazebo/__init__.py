"""Rigid-body physics with Gazebo's physics library."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "physics with Gazebo's library")
