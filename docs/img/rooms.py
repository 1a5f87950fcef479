"""Draws rooms.svg, the picture in docs/architecture.md, from the table of rooms there.

python docs/img/rooms.py
"""

import re
from collections import defaultdict
from pathlib import Path

HERE = Path(__file__).resolve().parent
WIDTH, FLOOR, GAP, LEFT, TOP = 920, 50, 6, 76, 74  # px
ROOMS = HERE.parent.parent / "evoros"
FILLS = {"parts": "#d5e8d4", "other": "#e8edf3", "analysis": "#fdf0d5"}
STROKES = {"parts": "#5a9a56", "other": "#7088a3", "analysis": "#c99a2e"}


def floors(document: str) -> dict[int, list[tuple[str, str]]]:
    """Name and purpose of the rooms on each floor; the rooms of analysis/ are one here."""
    rows = re.findall(r"^\| `(\w+)/(\w*)(?:/|\.py)?` \| (\d+) \| ([^|]+) \|", document, re.M)
    rooms: dict[int, list[tuple[str, str]]] = defaultdict(list)
    for package, folder, floor, purpose in rows:
        if package == "evoros":
            rooms[int(floor)].append((folder, purpose))
    (number,) = {int(floor) for package, _, floor, _ in rows if package == "analysis"}
    rooms[number].append(("analysis", "evoros analyze: figures, reports, videos"))
    return rooms


def label(x: float, y: float, content: str, size: int, style: str = "") -> str:
    """A line of text, centred at x, with its baseline at y [px]."""
    place = f'x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="middle"'
    return f"<text {place}{style}>{content}</text>"


def box(x: float, y: float, width: float, name: str, purpose: str) -> list[str]:
    """A room with its upper left corner at x and y [px]."""
    replaceable = (ROOMS / name / "protocol.py").exists()
    kind = "parts" if replaceable else "analysis" if name == "analysis" else "other"
    middle = x + width / 2
    return [
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{FLOOR - GAP}" rx="4"'
        f' fill="{FILLS[kind]}" stroke="{STROKES[kind]}"/>',
        label(middle, y + 19, name, 15, ' font-weight="bold"'),
        label(middle, y + 36, purpose, 12, ' fill="#333333"'),
    ]


def drawing(document: str) -> str:
    """The picture as SVG."""
    rooms = floors(document)
    inner = WIDTH - 2 * LEFT
    bottom = TOP + len(rooms) * FLOOR
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {bottom + 40}"'
        ' font-family="Helvetica, Arial, sans-serif">',
        f'<rect width="{WIDTH}" height="{bottom + 40}" fill="#ffffff"/>',
        f'<path d="M {LEFT - 30} {TOP - 6} L {WIDTH / 2:g} 8 L {WIDTH - LEFT + 30} {TOP - 6} Z"'
        ' fill="#f4f4f4" stroke="#888888"/>',
        label(WIDTH / 2, 42, "evoros", 18, ' font-weight="bold"'),
        label(WIDTH / 2, 60, "one command, and import evoros", 12, ' fill="#333333"'),
    ]
    for floor in sorted(rooms, reverse=True):
        y = bottom - floor * FLOOR
        lines.append(label(LEFT - 24, y + 27, str(floor), 13, ' fill="#888888"'))
        width = (inner + GAP) / len(rooms[floor])
        for column, (name, purpose) in enumerate(rooms[floor]):
            lines += box(LEFT + column * width, y, width - GAP, name, purpose)
    arrow = WIDTH - LEFT + 24
    lines += [
        f'<path d="M {arrow} {TOP + 10} V {bottom - 16} m -6 -10 l 6 10 l 6 -10" fill="none"'
        ' stroke="#888888" stroke-width="2"/>',
        f'<g transform="rotate(90 {arrow + 14} {(TOP + bottom) / 2:g})">',
        label(arrow + 14, (TOP + bottom) / 2, "all imports point down", 13, ' fill="#666666"'),
        "</g>",
        label(WIDTH / 2, bottom + 18, "green: users add parts of their own", 13, ' fill="#3c7a38"'),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    document = (HERE.parent / "architecture.md").read_text()
    (HERE / "rooms.svg").write_text(drawing(document))
