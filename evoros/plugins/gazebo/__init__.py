"""Rigid-body physics with Gazebo's library."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "physics with Gazebo's library")
