"""The subcommand ``watch``: a browser page that follows running runs."""

from evoros.files.plugins import Plugin, Subcommand

PLUGIN = Plugin(
    __name__,
    "runs on a page in the browser that follows them",
    subcommands={
        "watch": Subcommand(
            f"{__name__}.command:watch",
            "FOLDER",
            "follow runs on a page in the browser",
            ("--port",),
        )
    },
)
