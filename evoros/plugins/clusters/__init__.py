"""An executor that runs missions on the workers of a Dask cluster."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "missions on the machines of a Dask cluster", extras=("dask",))
