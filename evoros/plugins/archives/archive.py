"""The subcommand ``archive``, which packs a study and its inputs into a reproducible archive."""

from collections.abc import Sequence
from pathlib import Path

from evoros.files.origin import read_origin
from evoros.files.resources import expand_home
from evoros.terminal.console import DONE, CommandParser, print_result, reports_errors

NAME = "evoros archive"
ABOUT = """Write finished runs, evaluations and sweeps into one zip file, an RO-Crate.

The file contains the folders, your own parts, all robots, worlds and meshes that the runs use, the
versions of all packages, uncommitted changes to evoros, and a README. It contains no log, no path
of this machine and no value of an environment variable. evoros reproduce FILE reruns the study;
evoros analyze, status, diff and evoros.load_run read the file like a folder. Like evoros resume,
this command creates objects of your parts, which runs their code. Exit status: 0 done,
2 invalid input, 130 interrupted."""


@reports_errors(NAME)
def archive(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    from evoros.plugins.archives.writing import Request, write_archive

    parser = CommandParser(NAME, description=ABOUT)
    parser.add_argument("folders", nargs="+", type=expand_home, metavar="FOLDER")
    about = "the new file (default: the first folder's name, in the current folder)"
    parser.add_argument("--output", type=expand_home, metavar="FILE.zip", help=about)
    about = "folder with your own parts"
    parser.add_argument("--config-dir", type=expand_home, metavar="DIR", help=about)
    about = "SPDX identifier of the study's licence, such as CC-BY-4.0"
    parser.add_argument("--license", metavar="NAME", help=about)
    about = "an author of the study; may be repeated"
    parser.add_argument("--author", action="append", default=[], metavar="NAME", help=about)
    parser.add_argument("--version", action="version", version=f"{NAME} {read_origin().version}")
    options = parser.parse(arguments)
    output = options.output or Path(f"{options.folders[0].resolve().name}.zip")
    if output.suffix != ".zip":
        output = output.with_name(f"{output.name}.zip")
    rights = options.license, options.author
    count = write_archive(Request(options.folders, output, options.config_dir, *rights))
    print_result(f"{output}: {count} files, {output.stat().st_size / 2**20:.1f} MiB")
    return DONE
