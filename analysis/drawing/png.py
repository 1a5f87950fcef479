"""Writes figures as small PNG files: most have few colours, for which a palette is enough."""

from io import BytesIO
from pathlib import Path
from typing import IO

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

DPI = 300
"""Dots per inch that print needs."""
COLOURS = 256
VISIBLE = 0.1
"""Mean error of a palette, in steps of 1/255, above which a picture keeps all of its colours."""


def write_png(figure: Figure, file: Path | str | IO[bytes], dpi: float = DPI) -> None:
    """Write a figure with a palette of 256 colours, if these are enough."""
    whole = BytesIO()
    figure.savefig(whole, format="rgba", dpi=dpi)  # a PNG would be compressed twice
    width, height = (int(length * dpi) for length in figure.get_size_inches())
    save_png(Image.frombytes("RGBA", (width, height), whole.getbuffer()), file, dpi)


def save_png(picture: Image.Image, file: Path | str | IO[bytes], dpi: float = DPI) -> None:
    """Write a picture likewise; one that is transparent anywhere keeps its colours."""
    chosen = picture
    if np.asarray(picture.convert("RGBA"))[..., 3].min() == 255:
        opaque = picture.convert("RGB")
        small = opaque.quantize(COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        error = np.abs(np.asarray(small.convert("RGB"), dtype=int) - np.asarray(opaque)).mean()
        chosen = opaque if error > VISIBLE else small
    chosen.save(file, "PNG", optimize=True, dpi=(dpi, dpi))
