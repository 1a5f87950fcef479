"""Rows of the benchmark's leaderboard, made from finished runs and verified by rerunning."""

from evoros.files.plugins import Plugin, Subcommand

PLUGIN = Plugin(
    __name__,
    "rows of the benchmark",
    subcommands={
        "leaderboard": Subcommand(
            f"{__name__}.subcommand:leaderboard",
            "FOLDER ...",
            "make rows of the benchmark, or check them",
            ("--check", "--known", "--config-dir"),
        )
    },
)
