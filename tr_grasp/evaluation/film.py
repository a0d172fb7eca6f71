"""Pictures one after the other: GIF, MP4 or one long PNG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from tr_grasp.errors import ConfigError
from tr_grasp.files import write_atomically

Picture = NDArray[np.uint8]

FORMATS = (".gif", ".mp4", ".png")
GIF_BYTES = 1_500_000
LAST_FRAME_S = 1.5
_ATTEMPTS = ((1.0, 1, 96), (1.0, 2, 96), (0.75, 2, 64), (0.5, 3, 48), (0.35, 5, 32))
"""Scale, every which frame, colours: tried in turn until the file is small enough."""
_STRIP_PICTURES = 6


def check_format(path: Path) -> None:
    """Refuse a file name that :func:`save_film` could not write.

    Raises:
        ConfigError: For another ending than GIF, MP4 or PNG.
    """
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(f"view must end in {', '.join(FORMATS)}, got {str(path)!r}.")


def save_film(path: Path, pictures: Sequence[Picture], frame_s: float, gif_bytes: int = GIF_BYTES) -> None:
    """Write a film as its file name says; a PNG shows up to six pictures below each other.

    Args:
        path: The file; its folder exists.
        pictures: ``(h, w, 3)`` each, all of one size.
        frame_s: How long each is shown.
        gif_bytes: Size that a GIF is to stay below.

    Raises:
        ConfigError: For another ending than GIF, MP4 or PNG.
        StorageError: If it cannot be written.
    """
    check_format(path)
    ending = path.suffix.lower()
    if ending == ".gif":
        content = encode_gif(pictures, frame_s, gif_bytes)
    elif ending == ".mp4":
        content = encode_mp4(pictures, frame_s)
    else:
        content = encode_strip(pictures)
    write_atomically(path, content)


def encode_gif(pictures: Sequence[Picture], frame_s: float, limit_bytes: int = GIF_BYTES) -> bytes:
    """An endless GIF of at most ``limit_bytes`` if coarser and fewer pictures can do it; the last one stays longer."""
    content = b""
    for scale, stride, colours in _ATTEMPTS:
        kept = [*pictures[:-1:stride], pictures[-1]]
        content = _gif([_scaled(picture, scale) for picture in kept], frame_s * stride, colours)
        if len(content) <= limit_bytes:
            break
    return content


def encode_mp4(pictures: Sequence[Picture], frame_s: float) -> bytes:
    """An H.264 film that every browser plays."""
    still = [pictures[-1]] * round(LAST_FRAME_S / frame_s)
    # The codec wants even sizes.
    height, width = (size // 2 * 2 for size in pictures[0].shape[:2])
    even = np.stack([picture[:height, :width] for picture in [*pictures, *still]])
    return imageio.imwrite("<bytes>", even, extension=".mp4", plugin="FFMPEG", fps=1 / frame_s, macro_block_size=2)


def encode_strip(pictures: Sequence[Picture]) -> bytes:
    """The first, the last and evenly spread pictures between them, below each other, as PNG."""
    chosen = np.unique(np.linspace(0, len(pictures) - 1, _STRIP_PICTURES).round().astype(int))
    return encode_png(np.concatenate([pictures[index] for index in chosen]))


def encode_png(picture: Picture) -> bytes:
    """One picture."""
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG", optimize=True)
    return stream.getvalue()


def _scaled(picture: Picture, scale: float) -> Image.Image:
    image = Image.fromarray(picture)
    return (
        image
        if scale == 1
        else image.resize((round(image.width * scale), round(image.height * scale)), Image.Resampling.BOX)
    )


def _gif(images: Sequence[Image.Image], frame_s: float, colours: int) -> bytes:
    # One palette for all, without dithering: what stands still stays equal from frame to frame and costs nothing.
    palette = _palette(images, colours)
    indexed = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    milliseconds = [round(1000 * frame_s)] * (len(images) - 1) + [round(1000 * LAST_FRAME_S)]
    stream = io.BytesIO()
    indexed[0].save(
        stream, "GIF", save_all=True, append_images=indexed[1:], duration=milliseconds, loop=0, optimize=False
    )
    return stream.getvalue()


def _palette(images: Sequence[Image.Image], colours: int) -> Image.Image:
    samples = [images[0], images[len(images) // 2], images[-1]]
    sheet = Image.new("RGB", (samples[0].width, sum(sample.height for sample in samples)))
    for row, sample in enumerate(samples):
        sheet.paste(sample, (0, row * sample.height))
    return sheet.quantize(colours, method=Image.Quantize.MEDIANCUT)
