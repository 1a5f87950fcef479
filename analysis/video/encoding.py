"""Pictures as a video: the same bytes for the same pictures on one machine."""

import io
import tempfile
from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from pathlib import Path

import av
import numpy as np
from PIL import Image

from .camera import Pixels

# Bit-exact: without the names and versions of what wrote it, and without dates. Its table of
# contents comes first, so that it plays while it is loaded.
_CONTAINER = {"fflags": "+bitexact", "movflags": "+faststart"}
_CODEC = {"crf": "21", "preset": "fast"}  # 18 cannot be told from the original, 28 can
_END_MS = 1000.0  # for how long a GIF shows its last picture, before it begins again
_COLOURS = 256  # of a GIF, in all its pictures alike
_EVERY, _SAMPLE = 3, 60


def mp4(pictures: Iterable[Pixels], fps: float) -> bytes:
    """H.264, of at least one picture (h, w, 3) of even width and height."""
    source = iter(pictures)
    first = next(source)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.mp4"
        with av.open(str(path), "w", format="mp4", container_options=_CONTAINER) as container:
            rate = Fraction(fps).limit_denominator(1000)
            stream = container.add_stream("libx264", rate=rate, options=_CODEC)
            stream.height, stream.width = first.shape[:2]
            stream.pix_fmt = "yuv420p"  # what browsers and slides play
            stream.codec_context.thread_count = 1  # else the bytes depend on the number of cores
            stream.codec_context.flags |= av.codec.context.Flags.bitexact
            for picture in chain([first], source):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode(None))
        return path.read_bytes()


def gif(pictures: Iterable[Pixels], fps: float) -> bytes:
    """An endless loop of at least one picture (h, w, 3); all are in memory at the same time."""
    each = list(pictures)
    # Every so many pixels of every so many pictures, each of which may have colours of its own.
    sample = np.concatenate([one[::_EVERY, ::_EVERY] for one in each[:: 1 + len(each) // _SAMPLE]])
    palette = Image.fromarray(sample).quantize(_COLOURS, kmeans=2)
    images = [
        Image.fromarray(one).quantize(palette=palette, dither=Image.Dither.NONE) for one in each
    ]
    pause = [1000.0 / fps] * (len(images) - 1) + [_END_MS]
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=pause, loop=0)
    return file.getvalue()
