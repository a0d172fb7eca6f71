from __future__ import annotations

import io
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from PIL import Image

from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.film import check_format, encode_gif, encode_strip, save_film


def moving_square(n: int, size: tuple[int, int] = (48, 64)) -> list[np.ndarray]:
    pictures = []
    for step in range(n):
        picture = np.full((*size, 3), 30, np.uint8)
        picture[10:20, 2 * step : 2 * step + 8] = (220, 60, 60)
        pictures.append(picture)
    return pictures


def frames_of(gif: bytes) -> list[tuple[np.ndarray, int]]:
    image = Image.open(io.BytesIO(gif))
    found = []
    for index in range(image.n_frames):
        image.seek(index)
        found.append((np.asarray(image.convert("RGB")), image.info["duration"]))
    return found


def test_a_small_gif_keeps_every_picture_and_shows_the_last_one_longer() -> None:
    pictures = moving_square(12)
    found = frames_of(encode_gif(pictures, 0.125))
    assert len(found) == 12
    assert [duration for _, duration in found] == [120] * 11 + [1500] or [d for _, d in found] == [125] * 11 + [1500]
    for (shown, _), picture in zip(found, pictures, strict=True):
        assert np.abs(shown.astype(int) - picture).max() <= 8


def test_a_large_gif_is_made_coarser_until_it_fits() -> None:
    rng = np.random.default_rng(0)
    noise = [rng.integers(0, 255, (120, 160, 3), dtype=np.uint8) for _ in range(20)]
    large = encode_gif(noise, 0.1, limit_bytes=10**9)
    small = encode_gif(noise, 0.1, limit_bytes=len(large) // 4)
    assert len(small) <= len(large) // 4
    # Fewer pictures, each shown longer: the film lasts about as long.
    seconds = [sum(duration for _, duration in frames_of(gif)) for gif in (large, small)]
    assert seconds[1] == pytest.approx(seconds[0], rel=0.15)


def test_a_film_of_one_picture_is_a_film() -> None:
    assert len(frames_of(encode_gif(moving_square(1), 0.1))) == 1


def test_a_png_shows_the_first_and_the_last_picture() -> None:
    pictures = moving_square(25)
    strip = np.asarray(Image.open(io.BytesIO(encode_strip(pictures))))
    assert strip.shape == (6 * 48, 64, 3)
    assert (strip[:48] == pictures[0]).all()
    assert (strip[-48:] == pictures[-1]).all()


def test_an_mp4_plays_every_picture_and_holds_the_last(tmp_path: Path) -> None:
    save_film(tmp_path / "film.mp4", moving_square(10), 0.125)
    assert imageio.imread(tmp_path / "film.mp4", plugin="FFMPEG").shape == (10 + 12, 48, 64, 3)


@pytest.mark.parametrize("ending", ["gif", "GIF", "png"])
def test_the_file_name_decides(tmp_path: Path, ending: str) -> None:
    save_film(tmp_path / f"film.{ending}", moving_square(3), 0.1)
    assert Image.open(tmp_path / f"film.{ending}").format == ending.upper()


def test_another_ending_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"view must end in \.gif, \.mp4, \.png, got 'film\.avi'"):
        check_format(Path("film.avi"))
