"""Encode pictures as a video; equal pictures give equal bytes on one machine."""

import io
import tempfile
from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from pathlib import Path

import numpy as np
from PIL import Image

from evoros.base.extras import require_extra

from .camera import Pixels

# Bit-exact: without dates, names and versions of encoders. The index comes first, so that the
# video plays while it is loaded.
_CONTAINER = {"fflags": "+bitexact", "movflags": "+faststart"}
_CODEC = {"crf": "21", "preset": "fast"}  # 18 looks like the original, 28 has visible artefacts
_END_MS = 1000.0  # how long a GIF shows its last picture before it begins again
_COLOURS = 256  # of a GIF, the same in all its pictures
_PIXEL_STEP, _MAX_SAMPLE = 3, 60  # sample of pixels and pictures from which they are chosen


def encode_mp4(pictures: Iterable[Pixels], fps: float) -> bytes:
    """Encode at least one picture (h, w, 3) of even width and height as H.264.

    Raises:
        InputError: the package av is not installed.
    """
    with require_extra("video", "evoros analyze video --format mp4"):
        import av
    source = iter(pictures)
    first = next(source)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.mp4"
        with av.open(str(path), "w", format="mp4", container_options=_CONTAINER) as container:
            rate = Fraction(fps).limit_denominator(1000)
            stream = container.add_stream("libx264", rate=rate, options=_CODEC)
            stream.height, stream.width = first.shape[:2]
            stream.pix_fmt = "yuv420p"  # the format that browsers and slides play
            stream.codec_context.thread_count = 1  # else the bytes depend on the number of cores
            stream.codec_context.flags |= av.codec.context.Flags.bitexact
            for picture in chain([first], source):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode(None))
        return path.read_bytes()


def encode_gif(pictures: Iterable[Pixels], fps: float) -> bytes:
    """Encode at least one picture (h, w, 3) as an endless GIF, with all pictures in memory."""
    frames = list(pictures)
    sampled = frames[:: 1 + len(frames) // _MAX_SAMPLE]
    sample = np.concatenate([frame[::_PIXEL_STEP, ::_PIXEL_STEP] for frame in sampled])
    palette = Image.fromarray(sample).quantize(_COLOURS, kmeans=2)
    images = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    durations = [1000.0 / fps] * (len(images) - 1) + [_END_MS]
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=durations, loop=0)
    return file.getvalue()
