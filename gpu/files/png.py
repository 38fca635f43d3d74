"""PNG: one output as a picture that every viewer shows."""

from __future__ import annotations

from pathlib import Path

from halfstep.files.filetype import FrameType
from halfstep.files.picture import MOST, picture
from halfstep.files.provenance import NAME, Provenance, software, to_text
from halfstep.frames.frame import Frame
from halfstep.frames.png import png


def _write(path: Path, frame: Frame, outputs: tuple[str, ...], facts: Provenance) -> Provenance:
    pixels, range_ = picture(frame, *outputs)
    if range_ is not None:
        facts = facts.copy()
        facts["range"] = list(range_)
    path.write_bytes(png(pixels, texts(facts)))
    return facts


def texts(facts: Provenance) -> dict[str, str]:
    """The texts that a PNG records, by keyword."""
    return {"Software": software(facts), NAME: to_text(facts)}


def _read(path: Path) -> str | None:
    from PIL.PngImagePlugin import PngImageFile

    # Image.open refuses pictures as large as Halfstep's may be.
    with PngImageFile(path) as image:
        return image.info.get(NAME)


PNG = FrameType(
    name="PNG",
    endings=(".png",),
    default=("image",),
    write=_write,
    read=_read,
    single=True,
    most_solids=MOST,
)
