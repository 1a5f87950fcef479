"""The missions of designs in an archive and a front, as the page of a report plays them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial

from markupsafe import Markup

from ..drawing.gallery import choose_apart
from ..tables.shown import read_shown
from ..tables.study import Study
from .design_map import DesignMap
from .ground import Json
from .playback import encode_shown
from .templates import render

MAX_RECORDS = 300
"""Maximum number of records of a mission of a design in a map."""


@dataclass
class Missions:
    """The missions of designs that are in the page, and the grounds that these share."""

    playbacks: dict[tuple[str, int], Markup] = field(default_factory=dict)  # by run and design
    maps: dict[tuple[str, int], list[str]] = field(default_factory=dict)  # with the design, by key
    labels: dict[tuple[str, int], str] = field(default_factory=dict)
    grounds: dict[str, Json] = field(default_factory=dict)

    def list_playbacks(self) -> Iterator[Json]:
        """Yield the missions of the designs, for the templates."""
        for key, content in self.playbacks.items():
            about = {"label": self.labels[key], "key": f"{key[0]}/{key[1]}"}
            yield {**about, "content": content, "players": self.maps[key]}

    def render(self, chosen: DesignMap) -> Markup:
        """Render a map, and the player of its designs."""
        keys = [(record.name, design) for record, design in chosen.designs]
        playable = [key in self.playbacks for key in keys]
        return render("map.html", map=chosen, playable=playable, played=sum(playable))


def collect_missions(maps: Mapping[str, DesignMap], study: Study, max_bytes: float) -> Missions:
    """Encode missions of the maps' designs, which take turns, up to ``max_bytes`` together."""
    missions = Missions()
    size = 0
    for map_key, index in _take_turns(maps):
        chosen = maps[map_key]
        record, design = chosen.designs[index]
        key = (record.name, design)
        if key not in missions.playbacks:
            shown = dict(study.read_each([record], partial(read_shown, design=design)))
            data = encode_shown(shown[record], MAX_RECORDS, missions.grounds) if shown else None
            if data is None or size + len(data) > max_bytes:
                continue
            size += len(data)
            missions.playbacks[key] = data
            missions.labels[key] = chosen.marks[index].name
        missions.maps.setdefault(key, []).append(map_key)
    return missions


def _take_turns(maps: Mapping[str, DesignMap]) -> Iterator[tuple[str, int]]:
    """Yield the key of a map and the number of a playable mark of it."""
    orders = {}
    for name, chosen in maps.items():
        playable = [i for i, mark in enumerate(chosen.marks) if mark.playable]
        apart = choose_apart(chosen.points[playable], len(playable)) if playable else []
        orders[name] = [playable[i] for i in apart]
    for turn in range(max(map(len, orders.values()), default=0)):
        for name, order in orders.items():
            yield from ((name, i) for i in order[turn : turn + 1])
