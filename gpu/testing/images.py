"""Pictures compared pixel by pixel with stored answers, and pictures of the differences."""

from __future__ import annotations

import io
import os
from operator import methodcaller
from pathlib import Path
from typing import Any

import numpy as np

from halfstep.contract.arrays import Bools, Bytes
from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.results import folder_of_test
from halfstep.testing.values import Values, array_of, leaf_types, unmasked

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

_AMBIGUOUS = (255, 176, 0)
_FAILED = (255, 0, 96)
_ENDINGS = (".npy", ".png")


def checked_image(found: Any) -> Values:
    """A picture, (H, W) or (H, W, channels).

    Raises:
        UsageError: it has another shape or type.
    """
    image = array_of(unmasked(found, "found"), "found")
    if image.ndim not in (2, 3) or image.size == 0:
        raise UsageError(f"found: shape {image.shape}, not (height, width) or more for channels")
    if any(leaf.kind not in "biuf" for leaf in leaf_types(image.dtype)) or image.dtype.names:
        raise UsageError(f"found: {image.dtype} is not a type of numbers")
    return image


def path_of(expected: Any) -> Path | None:
    """The path of a stored answer, from the folder of the test if it is a string.

    Raises:
        UsageError: its ending is unknown.
    """
    if not isinstance(expected, str | os.PathLike):
        return None
    path = Path(expected)
    if path.suffix not in _ENDINGS:
        raise UsageError(f"{expected}: a stored answer ends with {' or '.join(_ENDINGS)}")
    if isinstance(expected, str):
        path = (folder_of_test() or Path()) / path
    return path


def stored(path: Path) -> Values:
    """The answer that a file holds.

    Raises:
        UsageError: the file does not exist, or holds no answer.
    """
    from imageio.v3 import imread

    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file; --halfstep-regenerate writes it") from None
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from None
    try:
        if path.suffix == ".npy":
            found: Values = np.load(io.BytesIO(content), allow_pickle=False)
        else:
            found = imread(content, plugin="pillow", extension=".png")
    except (ValueError, OSError, EOFError, SyntaxError) as error:
        raise UsageError(f"{path}: {error}") from None
    return found


def store(path: Path, image: Values) -> None:
    """Write an answer; an existing file is replaced.

    Raises:
        UsageError: the file cannot hold it.
        HalfstepError: the system refuses to write.
    """
    from halfstep.files.whole import write_file
    from halfstep.frames.png import png

    if path.suffix == ".npy":
        buffer = io.BytesIO()
        np.save(buffer, image)
        content = buffer.getvalue()
    elif image.dtype != np.uint8 or image.shape[2:] not in ((), (3,), (4,)):
        raise UsageError(
            f"{path}: a PNG file holds uint8 (height, width), (height, width, 3) or (height, "
            f"width, 4), not {image.dtype} of shape {image.shape}; .npy holds it"
        )
    else:
        content = png(image)
    write_file(path, content)


def difference(found: Values, expected: Values, failed: Bools, ambiguous: Bools) -> bytes:
    """A PNG file of three pictures side by side: found, expected, and the differences.

    In the third the found picture is dark, failures are red and ambiguous pixels yellow.
    """
    from halfstep.frames.png import png

    pictures = _visible(found, expected)
    places = pictures[1] // 4
    for mask, color in ((ambiguous, _AMBIGUOUS), (failed, _FAILED)):
        places = np.where(mask[..., None], np.array(color, np.uint8), places)
    return png(np.concatenate([*pictures, places], axis=1))


def _visible(found: Values, expected: Values) -> list[Bytes]:
    """Both pictures as RGB; the least finite number expected is black, the greatest white."""
    low, high = 0.0, 1.0
    if found.dtype == np.uint8:
        high = 255.0
    finite = expected[np.isfinite(expected)].astype(np.float64)
    if found.dtype != np.uint8 and finite.size:
        low, high = min(low, float(finite.min())), max(high, float(finite.max()))
    shown = []
    for image in (found, expected):
        channels = image[..., None] if image.ndim == 2 else image
        empty = np.zeros_like(channels[..., :1])
        rgb = {1: [0, 0, 0], 2: [0, 1, 2]}.get(channels.shape[-1], [0, 1, 2])
        colors = np.concatenate([channels, empty], axis=-1)[..., rgb].astype(np.float64)
        levels = (
            255 * (np.nan_to_num(colors, nan=low, posinf=high, neginf=low) - low) / (high - low)
        )
        shown.append(np.clip(levels + 0.5, 0, 255).astype(np.uint8))
    return shown
