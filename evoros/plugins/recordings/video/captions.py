"""Writes captions into pictures of a video: mission progress and colour key."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from PIL import Image, ImageColor, ImageDraw, ImageFont

from evoros.analysis.drawing.style import BLUE, PURPLE, VERMILLION

Colour = tuple[int, int, int]
Font = ImageFont.FreeTypeFont | ImageFont.ImageFont
COLUMN_EM, WIDTH_EM = 11, 52  # width of a text column, and of a picture for all columns


def _rgb(name: str) -> Colour:
    red, green, blue = ImageColor.getrgb(name)[:3]
    return red, green, blue


CLEAR, NEAR, ERRING, FAILED = _rgb(BLUE), _rgb(VERMILLION), _rgb(PURPLE), (70, 70, 70)
_INK, _PAPER, _OPACITY = (30, 30, 30), (255, 255, 255), 0.8


class Caption(NamedTuple):
    """The caption of a picture."""

    left: Sequence[str]  # columns of the top strip
    right: str
    states: Sequence[tuple[int, ...]]  # colour of each sensor
    key: Sequence[tuple[Colour, str]]  # colours with their meanings


def write_caption(picture: Image.Image, caption: Caption) -> None:
    """Write a caption into strips at the top and bottom of a picture."""
    width, height = picture.size
    em = max(9, min(height // 32, width // WIDTH_EM))
    font, pad, strip = _font(em), em // 2, 2 * em
    for top in (0, height - strip):
        part = picture.crop((0, top, width, top + strip))
        paper = Image.new("RGB", part.size, _PAPER)
        picture.paste(Image.blend(part, paper, _OPACITY), (0, top))
    draw = ImageDraw.Draw(picture)
    last = len(caption.left) - 1
    end = width - 2 * pad - draw.textlength(caption.right, font)
    for column, text in enumerate(caption.left):
        left = pad + column * COLUMN_EM * em
        room = (end if column == last else left + COLUMN_EM * em) - left - pad
        draw.text((left, strip / 2), _shorten(draw, text, font, room), _INK, font, anchor="lm")
    draw.text((width - pad, strip / 2), caption.right, _INK, font, anchor="rm")
    middle = height - strip / 2
    x = _draw_states(draw, caption.states, em, pad, middle) + 2 * em
    for colour, meaning in caption.key:
        draw.rectangle((x, middle - 0.35 * em, x + 0.9 * em, middle + 0.35 * em), colour)
        draw.text((x + 1.3 * em, middle), meaning, _INK, font, anchor="lm")
        x += 2.8 * em + draw.textlength(meaning, font)


def _shorten(draw: ImageDraw.ImageDraw, text: str, font: Font, room: float) -> str:
    if draw.textlength(text, font) <= room:
        return text
    while text and draw.textlength(f"{text}...", font) > room:
        text = text[:-1]
    return f"{text}..."


def _draw_states(
    draw: ImageDraw.ImageDraw, states: Sequence[tuple[int, ...]], em: int, x: float, middle: float
) -> float:
    """Draw a numbered square for each sensor; return the x coordinate behind the last square."""
    font = _font(em)
    draw.text((x, middle), "sensors", _INK, font, anchor="lm")
    x += draw.textlength("sensors", font) + 0.6 * em
    for sensor, colour in enumerate(states):
        square = (x, middle - 0.72 * em, x + 1.44 * em, middle + 0.72 * em)
        draw.rounded_rectangle(square, 3, colour)
        draw.text((x + 0.72 * em, middle), str(sensor), _PAPER, font, anchor="mm")
        x += 1.7 * em
    return x


@cache
def _font(em: int) -> Font:
    return ImageFont.load_default(em)
