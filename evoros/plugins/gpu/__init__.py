"""Runs planar missions in batches, one per thread of an NVIDIA GPU."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "missions as threads of an NVIDIA GPU", extras=("gpu",))
