"""Archives of studies as RO-Crates: the subcommands ``archive`` and ``reproduce``."""

from evoros.files.plugins import Plugin, Subcommand

PLUGIN = Plugin(
    __name__,
    "a study and everything needed to rerun it, in one file",
    subcommands={
        "reproduce": Subcommand(
            f"{__name__}.reproduce:reproduce",
            "FOLDER",
            "rerun a folder and compare all bytes",
            ("--output", "--config-dir", "--version"),
        ),
        "archive": Subcommand(
            f"{__name__}.archive:archive",
            "FOLDER ...",
            "write a study and all its inputs into one file",
            ("--output", "--config-dir", "--license", "--author", "--version"),
        ),
    },
)
