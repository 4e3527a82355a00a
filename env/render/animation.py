"""Pictures and films of a record."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from PIL import Image
from steerclear.env.record_file import read_meta, validate
from steerclear.env.render.canvas import mix
from steerclear.env.render.renderer import Picture, pixels
from steerclear.env.render.scene import Arena, Scene
from steerclear.env.whole_file import whole_file
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.extras import missing

FORMATS = (".mp4", ".gif")
Progress = Callable[[int, int], None]


def save_frame(
    record: Mapping[str, np.ndarray],
    step: int,
    path: str | os.PathLike[str],
    width_px: int = 1280,
    theme: str = "light",
) -> Path:
    """Write one moment of a record as a PNG picture.

    Args:
        record: A record of T steps.
        step: 0..T; negative counts from the end.
        path: File to write.
        width_px: Width of the picture.
        theme: "light" or "dark".

    Returns:
        The path written.

    Raises:
        TraceError: The record is incomplete.
        ConfigError: There is no such step, or the file cannot be written.
    """
    picture, states = _picture_of(record, width_px, theme)
    if not -states <= step < states:
        raise ConfigError(f"there is no step {step}; the record has 0 to {states - 1}.")
    surface = picture.draw(Scene.from_record(record, step % states, picture.arena.dt_s))
    with whole_file(Path(path), ConfigError) as part:
        Image.fromarray(pixels(surface)).save(part, format="PNG")
    return Path(path)


def save_animation(
    record: Mapping[str, np.ndarray],
    path: str | os.PathLike[str],
    fps: float = 20.0,
    speedup: float = 4.0,
    progress: Progress | None = None,
    start_s: float = 0.0,
    end_s: float | None = None,
    width_px: int = 1280,
    theme: str = "light",
) -> Path:
    """Write a record as a film.

    Args:
        record: A record.
        path: File to write, ending in ``.mp4`` or ``.gif``.
        fps: Pictures per second.
        speedup: How many times faster than the game.
        progress: Called after each picture with the number done and the number of all.
        start_s: Time of the game at which to begin.
        end_s: Time of the game at which to stop; its end when left out.
        width_px: Width of the picture.
        theme: "light" or "dark".

    Returns:
        The path written.

    Raises:
        TraceError: The record is incomplete.
        ConfigError: The ending, a number, or the folder cannot be used.
    """
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise ConfigError(f"cannot write {target.name!r}; end the name in {' or '.join(FORMATS)}.")
    if not (0.0 < fps <= 100.0 and speedup > 0.0):
        raise ConfigError(f"fps is {fps} and speedup {speedup}; choose 0 < fps <= 100 and speedup > 0.")
    picture, states = _picture_of(record, width_px, theme)
    dt_s = picture.arena.dt_s
    last_s = (states - 1) * dt_s
    end_s = last_s if end_s is None else min(end_s, last_s)
    if not 0.0 <= start_s <= end_s:
        raise ConfigError(f"cannot show {start_s} s to {end_s} s; the record lasts from 0 to {last_s:.1f} s.")
    times_s = np.arange(start_s, end_s + 1e-9, speedup / fps)
    steps = np.minimum(np.round(times_s / dt_s).astype(int), states - 1)

    def frames() -> Iterator[np.ndarray]:
        for done, step in enumerate(steps, start=1):
            yield pixels(picture.draw(Scene.from_record(record, int(step), dt_s)))
            if progress is not None:
                progress(done, len(steps))

    with whole_file(target, ConfigError) as part:
        if target.suffix.lower() == ".gif":
            _write_gif(part, frames(), picture, fps)
        else:
            _write_mp4(part, frames(), picture.size_px, fps)
    return target


def _picture_of(record: Mapping[str, np.ndarray], width_px: int, theme: str) -> tuple[Picture, int]:
    """Return a picture for the record and the number of its states."""
    validate(record)
    return Picture(Arena.from_meta(read_meta(record)), width_px, theme), len(record["position"])


def _write_mp4(path: Path, frames: Iterator[np.ndarray], size_px: tuple[int, int], fps: float) -> None:
    try:
        import imageio_ffmpeg  # brings ffmpeg: only where a film is wanted
    except ModuleNotFoundError as error:
        raise missing(error, "a film (.mp4)") or error from error
    quality = ["-crf", "20", "-preset", "veryfast", "-movflags", "+faststart"]
    writer = imageio_ffmpeg.write_frames(
        os.fspath(path), size_px, fps=fps, codec="libx264", quality=None, output_params=quality, macro_block_size=1
    )
    writer.send(None)
    try:
        for frame in frames:
            writer.send(frame)
    finally:
        writer.close()


def _write_gif(path: Path, frames: Iterator[np.ndarray], picture: Picture, fps: float) -> None:
    """Write all frames with one palette: still water does not flicker, and frames stay small."""
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette(picture))
    images = (Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    duration_ms = max(20, 10 * round(100.0 / fps))
    next(images).save(path, save_all=True, append_images=images, duration=duration_ms, loop=0, disposal=1)


def _palette(picture: Picture) -> list[int]:
    """Return 256 colours: the theme's, the most frequent of the still field, and steps between marks and water."""
    theme = picture.theme
    marks = [*theme.team, theme.ink, theme.muted, theme.nominal, theme.changed, theme.violation]
    grounds = [*theme.water, theme.page, theme.plate]
    colours = [*marks, *grounds, theme.grid, theme.edge, theme.obstacle]
    seen, counts = np.unique(pixels(picture.still()).reshape(-1, 3), axis=0, return_counts=True)
    colours += [tuple(seen[k].tolist()) for k in np.argsort(counts)[::-1][:60]]
    for share in (0.3, 0.6, 0.8, 0.15, 0.45, 0.9):
        colours += [mix(mark, ground, share) for mark in marks for ground in grounds]
    return [part for colour in list(dict.fromkeys(colours))[:256] for part in colour]
