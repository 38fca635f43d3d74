"""The scene of a view, read anew when its file changes."""

from __future__ import annotations

import os
from pathlib import Path

from halfstep.errors import SceneError, UsageError
from halfstep.models import Look, as_scene, is_model, load
from halfstep.scene import CameraLike, Overrides, Scene, SceneLike, with_overrides

# What changes with a file: when it was written, how long it is, and which it is.
_Mark = tuple[int, int, int]


class Source:
    """A scene and where it comes from.

    Attributes:
        scene: the last one without faults, with what the options say in place of its own.
        fault: of the text of the file as it is now; empty where there is none.
    """

    def __init__(
        self,
        given: SceneLike,
        look: Look | None,
        camera: CameraLike | None,
        overrides: Overrides,
    ) -> None:
        """Read it.

        Raises:
            SceneError: with every fault.
            UsageError: the look is not of such a file.
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
        """Read the file if it has changed; whether it was read.

        It is read once it is the same twice, as programs write a file in several steps.
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
    """The file that may change, None where there is none."""
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
