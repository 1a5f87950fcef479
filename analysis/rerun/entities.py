"""Entities of a recording, and their values over time."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr

from evoros.base.arrays import Array

from ..video.camera import Pixels
from ..video.surfaces import Surface

TIME, GENERATION = "mission_time", "generation"
"""The timelines."""


class Entities(NamedTuple):
    """The entities below a path of a recording."""

    stream: rr.RecordingStream
    path: tuple[str, ...]

    def below(self, *names: str) -> "Entities":
        """Return the entities below a further path."""
        return Entities(self.stream, (*self.path, *names))

    @property
    def address(self) -> str:
        """The path as the viewer writes it."""
        return rr.new_entity_path([*self.path])

    def show(self, *things: rr.AsComponents) -> None:
        """Show things at all times."""
        for thing in things:
            self.stream.log(self.address, thing, static=True, strict=True)

    def show_over_time(self, times_s: Array, columns: Iterable[rr.ComponentColumn]) -> None:
        """Show a row of columns from each time of the mission on."""
        self._send(rr.TimeColumn(TIME, duration=times_s), columns)

    def show_over_generations(
        self, generations: Sequence[int], columns: Iterable[rr.ComponentColumn]
    ) -> None:
        """Show a row of columns from each generation on."""
        self._send(rr.TimeColumn(GENERATION, sequence=generations), columns)

    def _send(self, index: rr.TimeColumn, columns: Iterable[rr.ComponentColumn]) -> None:
        self.stream.send_columns(self.address, [index], columns, strict=True)


def to_mesh(surface: Surface, painted: bool = True) -> rr.Mesh3D:
    """Return a surface as a mesh, each corner with the normal and the colour of its triangle."""
    corners = surface.corners[:, :3].astype(np.float32)
    colours = np.repeat(np.round(255 * surface.colours).astype(np.uint8), 3, axis=0)
    return rr.Mesh3D(
        vertex_positions=corners,
        vertex_normals=np.repeat(surface.normals, 3, axis=0).astype(np.float32),
        vertex_colors=colours if painted else None,
    )


def find_changes(*columns: Array | Pixels) -> list[int]:
    """Return the rows, the first included, in which one of the columns (n, ...) has changed."""
    whole = np.hstack(
        [np.asarray(column, dtype=float).reshape(len(column), -1) for column in columns]
    )
    same = (whole[1:] == whole[:-1]) | (np.isnan(whole[1:]) & np.isnan(whole[:-1]))
    return [0, *(np.flatnonzero(~same.all(axis=1)) + 1).tolist()]
