"""A view without a canvas: it takes events and makes pictures.

`Session.draw` makes every picture; events only change what the next one shows. While something
moves, a picture is drawn at once with one sample in a pixel, and with fewer pixels if that takes
long. At rest it is drawn with all pixels and samples. Then a frame with error bounds is rendered.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.arrays import Array, Bytes
from halfstep.errors import AdapterError, SceneError, UsageError
from halfstep.frames import pick
from halfstep.frames.frame import Frame
from halfstep.scene import Camera
from halfstep.viewer import camera as cameras
from halfstep.viewer.events import is_whole
from halfstep.viewer.picture import picture_of
from halfstep.viewer.rendering import Kind, Rendering, Shown
from halfstep.viewer.state import KEYS, Facts, State, coarser, pressed
from halfstep.viewer.status import SEPARATOR, certainty, described
from halfstep.viewer.text import with_text
from halfstep.viewer.watch import Source

# After this many seconds without an event, a picture is drawn with all pixels and samples.
REST_AFTER = 0.2
# A frame with error bounds may take seconds, in which no event is answered. It is rendered after a
# pause of this many times its duration.
PATIENCE = 2.0
# Seconds between checks whether the file has changed.
LOOK_AFTER = 0.2
# A pointer that moves at most this many logical pixels between down and up has clicked.
CLICK = 3.0
# Radians for each logical pixel of a drag, and octaves for each unit of the wheel, whose notch has
# 100 units.
TURN = 0.01
OCTAVES = 0.0025
MOST_WHEEL = 1000.0
LEFT, RIGHT, MIDDLE = 1, 2, 3
# The longest side of a picture. A larger canvas stretches it.
LONGEST = 8192
BACKGROUND = 18
NO_MEMORY = "not enough memory for this picture"
# Keys that do not change the state.
QUIT, RESET, HELP = ("q", "Q", "Escape"), ("r", "R", "Home"), ("h", "H", "?")
HELP_LINES = (
    "drag: turn    right button, or Shift: move    wheel: zoom    click: tell what is there",
    *(f"{' '.join(row.names)}: {row.help}" for row in KEYS),
    f"{' '.join(RESET)}: the camera of the scene    {' '.join(HELP)}: this help    q Escape: quit",
)


class _Drag(NamedTuple):
    """A pointer that is down.

    Attributes:
        start: the place where it went down, in logical pixels.
        last: its last place.
        pans: True if it moves the scene, False if it turns it.
        depth: the depth of the point under it.
        moved: whether it has moved farther than a click may.
    """

    start: cameras.Place
    last: cameras.Place
    pans: bool
    depth: float
    moved: bool


class Session:
    """A view of one scene.

    Attributes:
        is_closed: whether the view has ended.
    """

    def __init__(
        self,
        source: Source,
        *,
        backend: str = "auto",
        adapter: str | int | None = None,
        tell: Callable[[str], object],
        rest_after: float = REST_AFTER,
        patience: float = PATIENCE,
    ) -> None:
        """Open a device.

        Args:
            source: the source of the scene.
            backend: "auto", "gpu" or "numpy".
            adapter: an index or a part of the name of a Vulkan adapter.
            tell: is called with a line about each clicked pixel.
            rest_after: seconds without an event after which a picture is at rest.
            patience: a frame with error bounds needs a pause of this many times its duration.

        Raises:
            AdapterError: no adapter is suitable.
            DeviceError: the driver refuses.
        """
        self._source = source
        self._rendering = Rendering(source.scene, backend, adapter)
        self._tell = tell
        self._rest_after, self._patience = rest_after, patience
        self._now = Shown(source.scene, None, State())
        self._good: Shown | None = None
        self._size, self._ratio = (1, 1), 1.0
        self._picture: Bytes | None = None
        self._frame: Frame | None = None
        # Whether that frame has all pixels and samples; the frame with its error bounds, once
        # rendered; and the seconds that the last such frame took.
        self._is_fine = True
        self._certain: Frame | None = None
        self._cost = 0.0
        self._is_stale = self._is_untold = True
        self._rest_at = self._certain_at = self._look_at = 0.0
        self._factor = 1
        self._drag: _Drag | None = None
        self._anchor: tuple[cameras.Place, float] | None = None
        self._clicked: cameras.Place | None = None
        self._note = self._status = self._certainty = ""
        self._helps = False
        # Whether the picture says that shaders are being compiled.
        self._announced = False
        self.is_closed = False

    def close(self) -> None:
        """Give the device back."""
        self.is_closed = True
        self._rendering.renderer.close()

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        return self._now.camera or self._now.scene.camera

    @property
    def state(self) -> State:
        """The settings of the view."""
        return self._now.state

    @property
    def lines(self) -> list[str]:
        """The lines of text in the picture."""
        help_ = HELP_LINES if self._helps else ()
        status = SEPARATOR.join(filter(None, (self._status, self._certainty)))
        said = [*help_, *self._source.fault.splitlines(), *self._note.splitlines(), status]
        return [line for line in said if line]

    @property
    def wants_draw(self) -> bool:
        """Whether a new picture would differ."""
        return self._is_untold or self._clicked is not None or self._due is not None

    @property
    def _due(self) -> Kind | None:
        """The kind of the frame to render now; None if there is nothing to render."""
        now = time.monotonic()
        if self._is_stale:
            return Kind.MOVING
        if not self._is_fine and now >= self._rest_at:
            return Kind.STILL
        if self._certain is None and (self._clicked is not None or now >= self._certain_at):
            return Kind.CERTAIN
        return None

    # ---------------------------------------------------------------------------- events

    def tick(self) -> bool:
        """Check whether the file has changed; return whether there is something to draw."""
        now = time.monotonic()
        if now >= self._look_at:
            self._look_at = now + LOOK_AFTER
            if self._source.poll():
                self._is_untold = True
                if not self._source.fault:
                    self._note, self._cost = "", 0.0
                    self._rendering.forget()
                    self._show(scene=self._source.scene)
        return self.wants_draw

    def handle(self, event: Mapping[str, Any]) -> None:
        """Handle an event of rendercanvas. A faulty event, which a page may send, is ignored."""
        if not is_whole(event):
            return
        match event["event_type"]:
            case "pointer_down":
                self._down(event)
            case "pointer_move":
                self._move(event)
            case "pointer_up":
                self._up(event)
            case "wheel":
                self._wheel(event)
            case "key_down":
                self._key(event)
            case "close":
                self.is_closed = True

    def _down(self, event: Mapping[str, Any]) -> None:
        button, place = event["button"], (event["x"], event["y"])
        if button in (LEFT, RIGHT, MIDDLE):
            pans = button != LEFT or "Shift" in event["modifiers"]
            self._drag = _Drag(place, place, pans, self._depth_at(self._pixel(place)), moved=False)

    def _move(self, event: Mapping[str, Any]) -> None:
        drag, place = self._drag, (event["x"], event["y"])
        if drag is None:
            return
        across, down = place[0] - drag.last[0], place[1] - drag.last[1]
        far = max(abs(place[0] - drag.start[0]), abs(place[1] - drag.start[1]))
        if not drag.moved and far <= CLICK:
            return
        self._drag = drag._replace(last=place, moved=True)
        if drag.pans:
            start, end = self._pixel(drag.last), self._pixel(place)
            self._show(camera=cameras.pan(self.camera, self._size, start, end, drag.depth))
        else:
            self._show(camera=cameras.orbit(self.camera, -TURN * across, TURN * down))

    def _up(self, event: Mapping[str, Any]) -> None:
        drag, self._drag = self._drag, None
        if drag is not None and not drag.moved and not drag.pans:
            self._clicked = self._pixel((event["x"], event["y"]))

    def _wheel(self, event: Mapping[str, Any]) -> None:
        turned = min(max(event["dy"], -MOST_WHEEL), MOST_WHEEL)
        place = self._pixel((event["x"], event["y"]))
        factor, depth = 2.0 ** (-OCTAVES * turned), self._depth_at(place)
        self._show(camera=cameras.zoom(self.camera, self._size, place, factor, depth))
        self._anchor = place, depth / factor

    def _key(self, event: Mapping[str, Any]) -> None:
        key = event["key"]
        if not {"Control", "Alt", "Meta"}.isdisjoint(event["modifiers"]):
            return
        if key in QUIT:
            self.is_closed = True
        elif key in RESET:
            self._now = self._now._replace(camera=None)
            self._show()
        elif key in HELP:
            self._helps, self._is_untold = not self._helps, True
        else:
            scene = self._now.scene
            facts = Facts(scene, self._most_steps, lambda: self._rendering.volume(scene))
            state = pressed(self.state, key, facts)
            if state is not None:
                self._note = ""
                self._show(state=state)

    def _show(self, **changes: Any) -> None:
        """Change what the next picture shows."""
        self._now = self._now._replace(**changes)
        self._is_stale, self._certain, self._anchor = True, None, None

    def _pixel(self, place: cameras.Place) -> cameras.Place:
        """A place in logical pixels, converted to pixels of the picture."""
        return place[0] * self._ratio, place[1] * self._ratio

    def _depth_at(self, place: cameras.Place) -> float:
        """The depth of the point last seen at a place, or of look_at if nothing was hit."""
        if self._anchor is not None and self._anchor[0] == place:
            return self._anchor[1]
        if self._frame is not None:
            row, column = _at(place, self._size, self._frame.depth)
            depth = float(self._frame.depth[row, column])
            if depth > 0:
                return depth
        return cameras.distance(self.camera)

    @property
    def _most_steps(self) -> int:
        """The most halvings of any solid in the last frame; at least 1."""
        return max([0 if self._frame is None else max(self._frame.info["steps"], default=0), 1])

    # ---------------------------------------------------------------------------- pictures

    def draw(self, size: cameras.Size, ratio: float = 1.0) -> Bytes:
        """The current picture, RGBA, (H, W, 4).

        Args:
            size: (width, height) in pixels.
            ratio: pixels for each logical pixel, along an axis.

        Raises:
            HalfstepError: nothing can be shown, or the device was lost.
        """
        size = min(size[0], LONGEST), min(size[1], LONGEST)
        if (size, ratio) != (self._size, self._ratio):
            self._size, self._ratio = size, ratio
            self._show()
        self._is_untold = False
        try:
            self._render()
        except (SceneError, AdapterError, UsageError, MemoryError) as error:
            self._go_back(error)
        width, height = size
        picture = self._picture
        if picture is None:
            picture = np.full((height, width, 3), BACKGROUND, np.uint8)
        return with_text(_stretched(picture, size), self.lines, ratio)

    def _render(self) -> None:
        """Render the frame that is due, if any, and answer a click."""
        kind = self._due
        if kind is not None:
            # Compiling takes seconds, so the picture announces it first.
            if not (self._announced or self._rendering.is_compiled(self._now, kind)):
                self._announced = self._is_untold = True
                self._status, self._certainty = "compiling shaders", ""
                return
            self._announced = False
            frame = self._frame_of(kind)
            self._take(kind, frame)
        if self._clicked is not None and self._certain is not None:
            row, column = _at(self._clicked, self._size, self._certain.depth)
            self._clicked = None
            self._note = pick.told(self._certain, row, column)
            self._tell(self._note)

    def _take(self, kind: Kind, frame: Frame) -> None:
        """Take a frame as the new picture, or as the error bounds of the present one."""
        seconds = frame.info["wall_ms"] / 1e3
        if kind is Kind.CERTAIN:
            self._certain, self._cost = frame, seconds
            self._certainty = certainty(frame)
        else:
            self._frame, self._good, self._is_stale = frame, self._now, False
            self._picture = picture_of(frame, self.state.output)
        if self._frame is not None:
            self._status = described(self._frame, self.state, self._size)
        if kind is Kind.MOVING:
            self._certainty = ""
            self._is_fine = self._now.samples == 1 and self._factor == 1
            self._factor = coarser(self._factor, 1e3 * seconds)
            self._rest_at = time.monotonic() + self._rest_after
            self._certain_at = self._rest_at + self._patience * self._cost
        elif kind is Kind.STILL:
            self._is_fine = True

    def _frame_of(self, kind: Kind) -> Frame:
        """Render a frame of the present view."""
        width, height = self._size
        if kind is Kind.MOVING:
            width, height = max(width // self._factor, 1), max(height // self._factor, 1)
        return self._rendering.frame(self._now, kind, (width, height))

    def _go_back(self, error: Exception) -> None:
        """Return to the last view that could be rendered, and show why the new one cannot."""
        if self._good is None:
            raise error
        self._note = str(error) or NO_MEMORY
        self._clicked, self._announced = None, False
        self._is_fine, self._certain_at = True, math.inf
        self._is_stale = self._now != self._good
        self._now = self._good


def _at(place: cameras.Place, size: cameras.Size, array: Array) -> tuple[int, int]:
    """Row and column of an array (H, W), which covers a picture, at a place of the picture."""
    height, width = array.shape
    column, row = int(place[0] * width / size[0]), int(place[1] * height / size[1])
    return min(max(row, 0), height - 1), min(max(column, 0), width - 1)


def _stretched(picture: Bytes, size: cameras.Size) -> Bytes:
    """A picture (H, W, 3) stretched to RGBA (height, width, 4) by repeating pixels."""
    # Each pixel is copied as one number, ten times as fast as by channels.
    (rows, columns), (width, height) = picture.shape[:2], size
    pixels = np.full((rows, columns), 0xFFFFFFFF, np.uint32)
    channels = pixels.view(np.uint8).reshape(rows, columns, 4)
    for channel in range(3):
        channels[..., channel] = picture[..., channel]
    if (rows, columns) != (height, width):
        pixels = pixels.take(np.arange(width) * columns // width, axis=1)
        pixels = pixels.take(np.arange(height) * rows // height, axis=0)
    return pixels.view(np.uint8).reshape(height, width, 4)
