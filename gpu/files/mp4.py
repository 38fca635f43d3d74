"""MP4 with H.264, which every player shows, written frame by frame.

This module uses av directly: imageio also uses av, but passes no options to the encoder.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from halfstep.files.filetype import MovieType, Rgb
from halfstep.files.provenance import Provenance, to_text

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.frame import VideoFrame
    from av.video.stream import VideoStream

# Some builds of FFmpeg lack this encoder.
_ENCODER = "libx264"
# Constant rate factor of x264, 0…51: a lower one gives better quality.
_RATE_FACTOR = "16"
# The bytes that x264 writes depend on its number of threads, so it must not depend on the machine.
_THREADS = 4
# The number of ITU-R BT.709, the colours of high-definition television, in H.264's tables.
_BT709 = 1
_LIMITED_RANGE = 1


def _write(path: Path, pictures: Iterable[Rgb], fps: float, facts: Provenance) -> None:
    import av
    from av.codec.codec import UnknownCodecError

    try:
        # With its index at the front, a film can be played while it loads.
        with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as film:
            film.metadata["comment"] = to_text(facts)
            stream: VideoStream | None = None
            for picture in pictures:
                if stream is None:
                    stream = _stream(film, picture, fps)
                film.mux(stream.encode(_bt709(picture)))
            if stream is not None:
                film.mux(stream.encode())
    except av.FFmpegError as error:
        raise OSError(error.errno, error.strerror) from error
    except UnknownCodecError as error:
        lacks = f"av has no encoder {_ENCODER}, which MP4 files need"
        raise OSError(errno.ENOSYS, lacks) from error


def _stream(film: OutputContainer, picture: Rgb, fps: float) -> VideoStream:
    """A stream for frames of the size of ``picture``."""
    from av.video.stream import VideoStream

    rate = Fraction(fps).limit_denominator(1001)
    stream = film.add_stream(_ENCODER, rate=rate, options={"crf": _RATE_FACTOR})
    assert isinstance(stream, VideoStream)  # the encoder decides the type of the stream
    stream.height, stream.width, _ = picture.shape
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    context.thread_count = _THREADS
    context.colorspace = context.color_primaries = context.color_trc = _BT709
    context.color_range = _LIMITED_RANGE
    return stream


def _bt709(picture: Rgb) -> VideoFrame:
    from av.video.frame import VideoFrame
    from av.video.reformatter import ColorRange, Colorspace

    return VideoFrame.from_ndarray(picture, format="rgb24").reformat(
        format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
    )


def _read(path: Path) -> str | None:
    import av

    with av.open(str(path)) as film:
        return film.metadata.get("comment")


MP4 = MovieType(name="MP4", write=_write, read=_read, even=True, package="av", extra="video")
