"""Figures in scripts and notebooks: the subcommands of ``evoros analyze`` as functions."""

from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.reading import Run

from .product import Product
from .robot_choice import make_product
from .subcommands import SUBCOMMANDS, import_subcommand, parse
from .tables.records import read_record
from .tables.study import Study
from .video.render_options import RenderOptions

OF_COMMAND = {"subcommand", "folders", "where", "treatments", "output", "style", "panel_letters"}
"""Options that choose runs, which a study has done, or say how files are written."""


def analyze(study: Study, figure: str, **options: Any) -> Product:
    """Make a figure and its tables, as ``evoros analyze FIGURE`` does, but write no files.

    ``figure`` is the name of a subcommand. ``options`` have the names of its options, with
    underscores: ``without_tables=True``, ``difference=[1.0]``.

    Raises:
        InputError: there is no such figure or option, or the study cannot give the figure.
    """
    if figure not in SUBCOMMANDS:
        raise InputError(
            f"figure: must be one of {', '.join(SUBCOMMANDS)}, not {figure!r}; correct the name"
        )
    parsed = parse([figure, "."])
    known = sorted(set(vars(parsed)) - OF_COMMAND)
    for name, value in options.items():
        if name not in known:
            raise InputError(
                f"{figure}: its options are {', '.join(known) or 'none'}, not {name!r}; correct "
                f"the name"
            )
        setattr(parsed, name, value)
    return make_product(import_subcommand(figure), study, parsed)


def film_champion(
    run: Run, world: str, trajectory: pd.DataFrame, options: RenderOptions | None = None
) -> bytes:
    """Film any mission of a run's champion, for example a replayed one; returns an MP4 file.

    ``trajectory`` has the columns of ``champion/trajectory_WORLD.csv``. A world that is renewed
    in each mission is shown as in the champion's first one.

    Raises:
        InputError: the run is not finished, PyBullet is not installed, or the trajectory does
            not fit.
    """
    from .video.encoding import encode_mp4  # with numba, which takes long to import
    from .video.film import film
    from .video.mission import place_trajectory

    shown = options or RenderOptions()
    mission = place_trajectory(read_record(run.path, run.path.name), world, trajectory)
    return encode_mp4(film(mission, shown), shown.fps)
