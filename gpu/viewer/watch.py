"""The scene of a view, which is read again when its file changes."""

from __future__ import annotations

import os
from pathlib import Path

from halfstep.errors import SceneError, UsageError
from halfstep.models import Look, as_scene, is_model, load
from halfstep.scene import CameraLike, Overrides, Scene, SceneLike, with_overrides

# A file's time of writing, size and inode, which change when the file changes.
_Mark = tuple[int, int, int]


class Source:
    """A scene and its origin.

    Attributes:
        scene: the last scene without faults, with the options that replace its settings.
        fault: the faults of the file's present text; empty if it has none.
    """

    def __init__(
        self,
        given: SceneLike,
        look: Look | None,
        camera: CameraLike | None,
        overrides: Overrides,
    ) -> None:
        """Read the scene.

        Raises:
            SceneError: the scene has faults, all of which the message lists.
            UsageError: files of this type cannot take an option of ``look``.
        """
        self._given = given
        self._look = look
        self._camera = camera
        self._overrides = overrides
        self._path = _path_of(given)
        self._mark = _mark(self._path)
        self._changed = False
        self.fault = ""
        self.scene = self._read()

    def poll(self) -> bool:
        """Read the file if it has changed, and return whether it was read.

        The file is read once two polls find it the same, because programs write it in several
        steps.
        """
        mark = _mark(self._path)
        if mark != self._mark:
            self._mark, self._changed = mark, True
            return False
        if not self._changed:
            return False
        self._changed = False
        try:
            self.scene = self._read()
        except (SceneError, UsageError) as error:
            self.fault = str(error)
        else:
            self.fault = ""
        return True

    def _read(self) -> Scene:
        if isinstance(self._given, str | os.PathLike):
            scene = load(self._given, self._look)
        else:
            scene = as_scene(self._given)
        return with_overrides(scene, camera=self._camera, **self._overrides)


def _path_of(given: SceneLike) -> Path | None:
    """The file that may change; None if the scene has no file."""
    if isinstance(given, str | os.PathLike) and (is_model(given) or Path(given).suffix == ".toml"):
        return Path(given)
    return None


def _mark(path: Path | None) -> _Mark | None:
    if path is None:
        return None
    try:
        facts = path.stat()
    except OSError:
        return None
    return facts.st_mtime_ns, facts.st_size, facts.st_ino
