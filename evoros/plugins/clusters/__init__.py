"""Missions in the workers of a dask cluster."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "missions on the machines of a dask cluster", extras=("dask",))
