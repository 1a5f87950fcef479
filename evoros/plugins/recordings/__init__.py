"""Recordings of missions: videos, rosbags, and files for the Rerun viewer."""

from typing import TYPE_CHECKING

from evoros.base.lazy import import_lazily
from evoros.files.plugins import Plugin

if TYPE_CHECKING:
    from evoros.plugins.recordings.video.camera import RenderOptions
    from evoros.plugins.recordings.video.film import film_champion

__all__ = ["PLUGIN", "RenderOptions", "film_champion"]

PLUGIN = Plugin(
    __name__,
    "videos, rosbags and recordings for Rerun",
    figures={
        "video": f"{__name__}.video.film",
        "bag": f"{__name__}.bags.bag",
        "rerun": f"{__name__}.rerun.subcommand",
    },
    exports=frozenset({"bag", "rerun"}),
    extras=("bags", "rerun", "video"),
)

if not TYPE_CHECKING:  # otherwise, type checkers would accept any name
    _HOMES = {"RenderOptions": "video.camera", "film_champion": "video.film"}
    __getattr__, __dir__ = import_lazily(__name__, _HOMES)
