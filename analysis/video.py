"""Pictures as a video: the same bytes for the same pictures on one machine."""

import io
from collections.abc import Iterable
from fractions import Fraction
from itertools import islice

import av
import numpy as np
from PIL import Image

from .camera import Pixels

_QUALITY = "21"  # of x264: 18 cannot be told from the original, 28 can
_END_MS = 1000.0  # for how long a GIF shows its last picture, before it begins again
_COLOURS = 128  # of a GIF, in all its pictures alike


def mp4(pictures: Iterable[Pixels], fps: float) -> bytes:
    """H.264, of pictures (h, w, 3) uint8 of even width and height."""
    file = io.BytesIO()
    # Bit-exact: without the names and versions of what wrote it, and without dates.
    with av.open(
        file, "w", format="mp4", container_options={"fflags": "+bitexact", "movflags": "+faststart"}
    ) as container:
        rate = Fraction(fps).limit_denominator(1000)
        stream = container.add_stream("libx264", rate=rate)
        stream.pix_fmt = "yuv420p"  # what browsers and slides play
        stream.options = {"crf": _QUALITY, "preset": "fast"}
        stream.codec_context.thread_count = 1  # else the bytes depend on the number of cores
        stream.codec_context.flags |= av.codec.context.Flags.bitexact
        for number, picture in enumerate(pictures):
            if number == 0:
                stream.height, stream.width = picture.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))
    return file.getvalue()


def gif(pictures: Iterable[Pixels], fps: float) -> bytes:
    """An endless loop of pictures (h, w, 3) uint8."""
    source = iter(pictures)
    first = list(islice(source, 1))
    sample = Image.fromarray(first[0])
    palette = sample.quantize(_COLOURS)
    frames = [_indexed(each, palette) for each in (*first, *source)]
    file = io.BytesIO()
    pause = [1000.0 / fps] * (len(frames) - 1) + [_END_MS]
    frames[0].save(file, "GIF", save_all=True, append_images=frames[1:], duration=pause, loop=0)
    return file.getvalue()


def _indexed(picture: Pixels, palette: Image.Image) -> Image.Image:
    return Image.fromarray(np.asarray(picture)).quantize(palette=palette, dither=Image.Dither.NONE)
