"""The worlds and the score of the BARN challenge."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "worlds and score of the BARN challenge")
