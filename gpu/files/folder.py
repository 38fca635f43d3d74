"""A folder of numbered frames that any number of runs and machines may fill.

A frame appears whole or not at all, so every frame in the folder is finished. A small manifest
records the scene and options of all frames. A killed run resumes when it is started again. Runs
need no locks, which some network file systems lack: frames with the same manifest are equal, so any
run may write a frame.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from halfstep.errors import HalfstepError, UsageError
from halfstep.files import write
from halfstep.files.whole import check_output_folder, finished_name, write_file
from halfstep.frames.frame import Frame
from halfstep.scene import Scene
from halfstep.version import __version__

MANIFEST = "animation.json"
_FRAME = re.compile(r"frame_\d{4,}\.png")

Manifest = dict[str, Any]


def manifest(scene: Scene, backend: str, adapter: str | int | None) -> Manifest:
    """Everything that the frames of an animated scene depend on, for people and for comparison."""
    animation, image, accuracy = scene.effective_animation(), scene.image, scene.accuracy
    return {
        "version": __version__,
        "title": scene.title,
        "scene_sha256": scene.sha256,
        "frames": animation.frames,
        "fps": animation.fps,
        "size": [image.width, image.height],
        "samples": image.samples,
        **accuracy.model_dump(exclude_none=True),
        "backend": backend,
        "adapter": adapter,
    }


class FrameFolder:
    """The frames of one animation in a folder: ``frame_0000.png`` and so on."""

    def __init__(
        self, path: str | os.PathLike[str], manifest: Manifest, *, overwrite: bool = False
    ) -> None:
        """Check that frames can be written to ``path``. This changes nothing there yet.

        Args:
            path: the folder; it is made when the first frame is written.
            manifest: the manifest of the frames.
            overwrite: replace frames that are in the folder already.

        Raises:
            UsageError: the folder cannot be written, or has frames of another manifest and
                ``overwrite`` is False.
        """
        self.path = Path(path)
        self._manifest = manifest
        self._overwrite = overwrite
        check_output_folder(self.path)
        if not overwrite:
            self._check_same()

    def missing(self, numbers: Iterable[int]) -> list[int]:
        """The frames among ``numbers`` that must be rendered."""
        return [each for each in numbers if self._overwrite or not self.frame_path(each).is_file()]

    def frame_path(self, number: int) -> Path:
        """The path of frame ``number``, whether it is there or not."""
        digits = max(4, len(str(self._manifest["frames"] - 1)))
        return self.path / f"frame_{number:0{digits}}.png"

    def begin(self, numbers: Iterable[int]) -> None:
        """Prepare the folder for the frames ``numbers``, which `missing` gave.

        Raises:
            UsageError: the folder has got frames of another manifest in the meantime.
            HalfstepError: the system refuses.
        """
        if not self._overwrite:
            self._check_same()
        same = self._is_same()
        with self._refusing():
            self.path.mkdir(parents=True, exist_ok=True)
            if self._overwrite:
                # Delete first: a killed run must leave no frame of another manifest, and no frame
                # that it was to render again.
                for frame in map(self.frame_path, numbers) if same else self._frames():
                    frame.unlink(missing_ok=True)
        if not same:
            text = json.dumps(self._manifest, indent=2) + "\n"
            write_file(self.path / MANIFEST, text.encode())

    def write(self, number: int, frame: Frame) -> None:
        """Write the image of frame ``number``, whole or not at all.

        Raises:
            HalfstepError: another run has changed the manifest; or the system refuses, for example
                on a full disk.
        """
        if not self._is_same():
            raise HalfstepError(f"{self.path}: {self._difference()}; another run has begun since")
        path = self.frame_path(number)
        try:
            write(path, frame, ("image",))
        except HalfstepError:
            # If another run has written this frame too, its `tidy` may remove this run's part.
            if not path.is_file():
                raise

    def tidy(self) -> None:
        """Remove half-written files of frames that are finished.

        Killed runs have left them, or other runs are still writing them; those will find the
        finished frame.

        Raises:
            HalfstepError: the system refuses.
        """
        with self._refusing():
            for path in self.path.iterdir():
                name = finished_name(path.name)
                if name is not None and _FRAME.fullmatch(name) and (self.path / name).is_file():
                    path.unlink(missing_ok=True)

    @contextmanager
    def _refusing(self) -> Iterator[None]:
        """Turn an OSError of the block into a HalfstepError."""
        try:
            yield
        except OSError as error:
            raise HalfstepError(f"{error.filename}: {error.strerror}") from error

    def _frames(self) -> Iterator[Path]:
        return (path for path in self.path.iterdir() if _FRAME.fullmatch(path.name))

    def _manifest_there(self) -> Manifest | None:
        """The manifest in the folder; None if it is missing or cannot be read."""
        try:
            there = json.loads((self.path / MANIFEST).read_bytes())
        except (OSError, ValueError, RecursionError):
            return None
        return there if isinstance(there, dict) else None

    def _is_same(self) -> bool:
        # JSON turns tuples into lists, so both sides are compared after a round trip.
        return self._manifest_there() == json.loads(json.dumps(self._manifest))

    def _check_same(self) -> None:
        if not self.path.is_dir() or self._is_same() or next(self._frames(), None) is None:
            return
        raise UsageError(f"{self.path}: {self._difference()}; --overwrite renders them again")

    def _difference(self) -> str:
        """The differences between the manifest in the folder and this one, in words."""
        there, here = self._manifest_there(), self._manifest
        if there is None:
            return f"has frames but no {MANIFEST} that says of what"
        names = [name for name in {**here, **there} if there.get(name) != here.get(name)]
        # The scene's hash covers most other facts, and tells people nothing.
        named = [name for name in names if name != "scene_sha256"]
        told = [f"{name} {there.get(name)} there, {here.get(name)} here" for name in named]
        return f"its frames are others: {', '.join(told) or 'the scene has changed'}"
