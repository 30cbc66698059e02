"""Writes frames to an MP4 or GIF file with the ffmpeg of imageio-ffmpeg."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from tdac_envs.core.errors import TdacError
from tdac_envs.drawing.canvas import Image

SUFFIXES = (".mp4", ".gif")
GIF_COLOURS = 64
# Every browser plays H.264 in yuv420p. The colour matrix is tagged, because some
# players would guess another one.
_PIXELS = "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"
_CODEC = ["-c:v", "libx264", "-preset", "veryfast", "-crf", "20"]
_TAGS = ["-colorspace", "bt709", "-movflags", "+faststart", "-f", "mp4"]
_LOSSLESS = ["-c:v", "libx264rgb", "-preset", "ultrafast", "-qp", "0"]


class VideoError(TdacError):
    """A video cannot be written."""


def write_video(frames: Iterable[Image], path: str | Path, fps: float) -> None:
    """Writes a video frame by frame; the file appears when it is complete.

    Args:
        frames: Each of shape (height, width, 3), uint8 RGB, all of one size. An MP4
            with an odd side loses its last row or column.
        path: Ends in `.mp4` or `.gif`.
        fps: Frames per second; a GIF rounds the time of a frame to 1/100 s. It has at
            most 64 colours, so that it stays small.

    Raises:
        VideoError: The suffix is unknown, there are no frames, they differ in size, or
            the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise VideoError(f"a video file must end in .mp4 or .gif, got {path.name!r}")
    try:
        scratch = tempfile.TemporaryDirectory(prefix=".film-", dir=path.parent)
    except OSError as error:
        raise VideoError(f"cannot write {path}: {error.strerror}") from error
    with scratch as folder:
        film = Path(folder, path.name)
        if suffix == ".mp4":
            _encode(frames, film, fps, ["-vf", _PIXELS, *_CODEC, *_TAGS])
        else:
            lossless = Path(folder, "frames.mkv")
            _encode(frames, lossless, fps, _LOSSLESS)
            _palettise(lossless, film)
        os.replace(film, path)


def _encode(
    frames: Iterable[Image], film: Path, fps: float, options: Sequence[str]
) -> None:
    """Pipes the frames through one ffmpeg process."""
    rest = iter(frames)
    first = next(rest, None)
    if first is None:
        raise VideoError("expected at least one frame, got none")
    height, width = first.shape[:2]
    if film.suffix == ".mp4":
        height, width = height - height % 2, width - width % 2
    size = f"{width}x{height}"
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", f"{fps:g}"]
    command = [*_ffmpeg(), *raw, "-i", "-", *options, str(film)]
    with tempfile.TemporaryFile() as messages:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=messages)
        try:
            _feed(process, chain([first], rest), first.shape, (height, width))
        except BaseException:
            process.kill()
            raise
        finally:
            code = process.wait()
        if code != 0:
            messages.seek(0)
            raise _failure(code, messages.read())


def _feed(
    process: subprocess.Popen[bytes],
    frames: Iterable[Image],
    shape: tuple[int, ...],
    size: tuple[int, int],
) -> None:
    pipe = process.stdin
    assert pipe is not None
    try:
        with pipe:
            for frame in frames:
                if frame.shape != shape or frame.dtype != np.uint8:
                    raise VideoError(
                        f"expected uint8 frames of shape {shape}, "
                        f"got {frame.dtype} {frame.shape}"
                    )
                pipe.write(np.ascontiguousarray(frame[: size[0], : size[1]]).data)
    except BrokenPipeError:
        return  # ffmpeg gave up; its exit code and messages say why


def _palettise(film: Path, target: Path) -> None:
    """Converts a video to a GIF with one palette, so that still areas never flicker."""
    palette = film.with_name("palette.png")
    make = f"palettegen=reserve_transparent=0:max_colors={GIF_COLOURS}"
    use = "paletteuse=dither=none:diff_mode=rectangle"
    passes = (
        ["-i", str(film), "-vf", make, str(palette)],
        ["-i", str(film), "-i", str(palette), "-lavfi", use, "-f", "gif", str(target)],
    )
    for options in passes:
        done = subprocess.run([*_ffmpeg(), *options], capture_output=True, check=False)
        if done.returncode != 0:
            raise _failure(done.returncode, done.stderr)


def _failure(code: int, messages: bytes) -> VideoError:
    """The error with ffmpeg's messages, or with its exit status if it has none."""
    end = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    return VideoError(f"ffmpeg failed: {messages.decode().strip() or end}")


def _ffmpeg() -> list[str]:
    """The bundled ffmpeg with the options common to all calls."""
    from imageio_ffmpeg import get_ffmpeg_exe

    return [get_ffmpeg_exe(), "-hide_banner", "-loglevel", "error", "-nostdin", "-y"]
