"""Reproduces archives by executing the code in them."""

from collections.abc import Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from evoros.base.errors import InputError
from evoros.config.recorded import relocate_recorded
from evoros.plugins.archives.layout import Layout
from evoros.plugins.archives.portable import PortableRun
from evoros.session.diff import Diff, diff_runs
from evoros.session.rebuilding import rebuild
from evoros.storage import archives
from evoros.storage.layout import CONFIG, CONFIG_DIR, MANIFEST, folders_below, read_json
from evoros.terminal.log import warn_left_out


@dataclass(frozen=True)
class Prepared:
    """Recorded runs, and a folder for rerunning them."""

    source: Path
    output: Path
    config_dir: Path | None
    base: Path | None = None  # folder with the unpacked inputs of an archive, if any

    def relocation(self, folder: Path) -> archives.Relocation:
        """Return the new paths of inputs that have moved since the recording."""
        if self.base is None:
            return archives.NOWHERE
        working = read_json(folder / MANIFEST)["working_directory"]
        return Layout({self.base / archives.INPUTS: archives.INPUTS}).relocation(working, {})

    def compare(self) -> Diff:
        """Compare the recorded runs with the new runs, in archived form if they were archived."""
        if self.base is None:
            return diff_runs(self.source, self.output)
        with TemporaryDirectory(prefix="evoros-") as scratch:
            for source in folders_below(self.source, warn_left_out):
                inner = source.relative_to(self.source)
                self._move(source, self.output / inner, Path(scratch) / inner)
            return diff_runs(self.source, Path(scratch))

    def _move(self, source: Path, folder: Path, to: Path) -> None:
        recorded, places = read_json(source / MANIFEST), self.relocation(source)
        built = rebuild(folder, (), self.config_dir, warns=False)
        config = relocate_recorded(folder / CONFIG, places.relocate)
        working, own = recorded["working_directory"], recorded.get(CONFIG_DIR)
        made = built.experiment, config.text, config.values
        run = PortableRun(folder, *made, places, working, own)
        for name, content in run.files():
            archives.write_unpacked(to / name, content)


@contextmanager
def prepare(source: Path, output: Path, config_dir: Path | None) -> Iterator[Prepared]:
    """Prepare the runs in a folder or archive (unpacked into ``output``) for a rerun."""
    archive = archives.find_archive(source)
    if archive is None:
        yield Prepared(source, output, config_dir)
        return
    runs = archives.open_folder(source)
    for folder in folders_below(runs, warn_left_out):
        _require_inside(archive, folder)
    base = output.absolute()
    top = next(place for place in (runs, *runs.parents) if place.name == archives.RUNS)
    try:
        _unpack_inputs(archive, base)
    except OSError as error:
        raise InputError(
            f"--output {output}: cannot be written ({error.strerror}); choose another folder"
        ) from error
    with chdir(base):
        folders = folders_below(runs, warn_left_out)
        named = (read_json(folder / MANIFEST).get(CONFIG_DIR) for folder in folders)
        own = next(filter(None, named), None)
        parts = base / own if own and config_dir is None else config_dir
        yield Prepared(runs, base / archives.RUNS / runs.relative_to(top), parts, base)


def _require_inside(archive: Path, folder: Path) -> None:
    manifest = read_json(folder / MANIFEST)
    for key in ("working_directory", CONFIG_DIR):
        path = PurePosixPath(manifest.get(key) or archives.INPUTS)
        if path.parts[0] != archives.INPUTS or ".." in path.parts:
            raise InputError(
                f"{archive}: {folder.name}/{MANIFEST}: {key} must be a path in {archives.INPUTS}/, "
                f"not {str(path)!r:.80}; archive the runs again"
            )


def _unpack_inputs(archive: Path, base: Path) -> None:
    base.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=f".{base.name}.", dir=base.parent) as scratch:
        archives.unpack(archive, lambda name: name.startswith(f"{archives.INPUTS}/"), Path(scratch))
        draft, inputs = Path(scratch) / archives.INPUTS, base / archives.INPUTS
        draft.mkdir(exist_ok=True)
        if not inputs.exists():
            if base.exists() and any(base.iterdir()):
                raise InputError(
                    f"--output {base}: must be a new folder or an earlier reproduction of "
                    f"{archive}; choose another folder"
                )
            base.mkdir(exist_ok=True)
            draft.rename(inputs)
        elif _read_all(inputs) != _read_all(draft):
            raise InputError(
                f"--output {inputs}: differs from the inputs of {archive}; choose another folder"
            )


def _read_all(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    read = {str(path.relative_to(folder)): path.read_bytes() for path in files}
    return {name: content for name, content in read.items() if "__pycache__" not in name}
