"""The subcommand ``watch``, a live web page about runs in progress."""

from evoros.files.plugins import Plugin, Subcommand

PLUGIN = Plugin(
    __name__,
    "a live browser page that shows runs",
    subcommands={
        "watch": Subcommand(
            f"{__name__}.command:watch", "FOLDER", "follow runs on a live browser page", ("--port",)
        )
    },
)
