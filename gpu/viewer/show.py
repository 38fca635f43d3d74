"""Chooses a canvas of rendercanvas, and runs a session on it until the view ends."""

from __future__ import annotations

import asyncio
import importlib
import importlib.util
import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from typing import Any, Unpack

from halfstep.contract.choices import CANVASES
from halfstep.errors import UsageError
from halfstep.scene import CameraLike, Overrides, SceneLike
from halfstep.viewer.events import FACTS
from halfstep.viewer.page import HOST, Server
from halfstep.viewer.session import Session
from halfstep.viewer.text import NARROWEST
from halfstep.viewer.watch import Source

# The packages that each canvas needs besides rendercanvas. The extra `view` installs them all.
_PACKAGES = {
    "glfw": ("glfw",),
    "http": ("uvicorn", "websockets"),
    "terminal": ("blessed",),
    "notebook": ("anywidget",),
}
_MODULES = {"notebook": "anywidget"}
# A canvas checks for events, and draws, at most this many times a second. A session checks after
# TICK seconds whether it has something to draw.
MOST_FPS = 200.0
TICK = 0.02


def view(
    scene: SceneLike,
    *,
    canvas: str = "auto",
    backend: str = "auto",
    adapter: str | int | None = None,
    camera: CameraLike | None = None,
    **overrides: Unpack[Overrides],
) -> Any:
    """Show a scene live. The pointer turns, moves and zooms it; a click describes the pixel.

    In a notebook this function returns at once, with a widget that the notebook shows. Elsewhere it
    returns when the window, or the page in a browser, is closed.

    Args:
        scene: the scene; see `render`. A file is read again when it changes.
        canvas: "glfw", a window; "http", a page for a browser; "terminal"; or "auto", which takes
            the notebook if there is one, else a window if there is a display, else a page.
        backend: "auto", "gpu" or "numpy"; see `render`.
        adapter: an index or a part of the name of a Vulkan adapter.
        camera: replaces the scene's camera; see `render`.
        overrides: size, steps and the other options of `halfstep.scene.Overrides`.

    Raises:
        SceneError: the scene is not found or has faults, or an option is out of range.
        UsageError: the canvas is unknown or not installed, or there is no display.
        AdapterError: no adapter is suitable.
        DeviceError: the device was lost or the driver failed.
    """
    source = Source(scene, None, camera, overrides)
    if canvas == "auto" and _is_notebook():
        return _show_in_notebook(source, backend, adapter)
    return show(source, canvas=canvas, backend=backend, adapter=adapter, tell=_tell, say=_say)


def show(
    source: Source,
    *,
    canvas: str,
    backend: str,
    adapter: str | int | None,
    tell: Callable[[str], object],
    say: Callable[[str], object],
    host: str = HOST,
    port: int = 0,
) -> None:
    """Show a scene until its window or page is closed.

    Args:
        source: the source of the scene.
        canvas: one of `CANVASES`.
        backend: "auto", "gpu" or "numpy"; see `render`.
        adapter: an index or a part of the name of a Vulkan adapter.
        tell: is called with each line for machines: the page's address, and clicked pixels.
        say: is called with each line for people.
        host: the address at which a page is served.
        port: the port of that address; 0 takes a free one.

    Raises:
        HalfstepError: one of the errors of `view`.
        KeyboardInterrupt: the user interrupted the view.
    """
    name = _chosen(canvas)
    image = source.scene.image
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        server = None
        if name == "http":
            server = stack.enter_context(closing(Server(host, port, (image.width, image.height))))
        session = stack.enter_context(
            closing(Session(source, backend=backend, adapter=adapter, tell=tell))
        )
        run = _Run(session, _canvas(name, source), stop=None if server is None else server.stop)
        if server is None:
            run.loop.run()
        else:
            tell(server.address)
            say("open this address in a browser; closing the page, or Ctrl-C, ends it")
            server.serve(run.close)
        run.finish()


class _Run:
    """A session and its canvas while they are open.

    An error in an event or a picture ends the view, and is raised at its end. rendercanvas alone
    would only log the error.
    """

    def __init__(
        self, session: Session, canvas: Any, stop: Callable[[], None] | None = None
    ) -> None:
        self._session = session
        self._canvas = canvas
        self._stop = stop
        self._was_interrupted = False
        self.failure: Exception | None = None
        self.loop = canvas._rc_canvas_group.get_loop()  # noqa: SLF001 - there is no other way
        self._context = canvas.get_bitmap_context()
        canvas.add_event_handler(self._handle, *FACTS)
        canvas.request_draw(self._draw)
        self.loop.add_task(self._ticking, name="halfstep")

    @contextmanager
    def _failing(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            self.failure = self.failure or error
            self._session.is_closed = True

    def _handle(self, event: dict[str, Any]) -> None:
        with self._failing():
            self._session.handle(event)
            if self._session.wants_draw:
                self._canvas.request_draw()

    def _draw(self) -> None:
        canvas, session = self._canvas, self._session
        if session.is_closed:
            return
        with self._failing():
            size = canvas.get_physical_size()
            picture = session.draw(size, canvas.get_pixel_ratio())
            self._context.set_bitmap(picture)
            if size[0] < NARROWEST:
                # The picture has no room for text, so the title shows it.
                canvas.set_title(session.lines[-1])
            if session.wants_draw:
                canvas.request_draw()

    async def _ticking(self) -> None:
        with self._failing(), self._interrupts():
            while not self._session.is_closed and not self._was_interrupted:
                if self._session.tick():
                    self._canvas.request_draw()
                await asyncio.sleep(TICK)
        self.close()

    @contextmanager
    def _interrupts(self) -> Iterator[None]:
        """Record that Ctrl-C was pressed, in place of rendercanvas's own handler."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def note(*_: object) -> None:
            self._was_interrupted = True

        before = signal.signal(signal.SIGINT, note)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def close(self) -> None:
        """Close the canvas."""
        self._session.is_closed = True
        if not self._canvas.get_closed():
            self._canvas.close()
        if self._stop is not None:
            self._stop()

    def finish(self) -> None:
        """Raise the error that ended the view, if any.

        Raises:
            Exception: an event or a picture failed.
            KeyboardInterrupt: the user interrupted the view.
        """
        if self.failure is not None:
            raise self.failure
        if self._was_interrupted:
            raise KeyboardInterrupt


def _show_in_notebook(source: Source, backend: str, adapter: str | int | None) -> Any:
    """Start a view, and return its widget."""
    _check("notebook")
    session = Session(source, backend=backend, adapter=adapter, tell=_tell)
    canvas = _canvas("notebook", source)
    run = _Run(session, canvas)

    def over(_: object) -> None:
        session.close()
        if run.failure is not None:
            _say(str(run.failure))

    canvas.add_event_handler(over, "close")
    return canvas


def _canvas(name: str, source: Source) -> Any:
    """A canvas with the size of the scene's picture."""
    module = importlib.import_module(f"rendercanvas.{_MODULES.get(name, name)}")
    image = source.scene.image
    class_ = module.RenderCanvas if name != "notebook" else _closed_once(module.RenderCanvas)
    return class_(
        size=(image.width, image.height),
        title=f"halfstep: {source.scene.title or source.scene.name}",
        max_fps=MOST_FPS,
    )


def _closed_once(class_: type[Any]) -> type[Any]:
    """A class of canvases without a fault of rendercanvas up to 2.7.2: `close` calls itself."""

    def close(canvas: Any) -> None:
        if not canvas.is_closing:
            canvas.is_closing = True
            class_.close(canvas)

    return type(class_.__name__, (class_,), {"close": close, "is_closing": False})


def _chosen(canvas: str) -> str:
    """The name of the canvas to use.

    Raises:
        UsageError: the canvas is unknown, or something that it needs is missing.
    """
    if canvas not in CANVASES:
        raise UsageError(f"canvas: {canvas!r} is not one of {', '.join(CANVASES)}")
    if canvas == "auto":
        has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
        canvas = "glfw" if has_display and _missing("glfw") is None else "http"
    _check(canvas)
    return canvas


def _check(canvas: str) -> None:
    """Check that a canvas can be used.

    Raises:
        UsageError: something is missing; the message tells what to do.
    """
    instead = "" if canvas in ("http", "notebook") else ", or take --canvas http"
    missing = _missing(canvas)
    if missing is not None:
        raise UsageError(
            f"--canvas {canvas}: needs the package {missing}: pip install 'halfstep[view]'{instead}"
        )
    if canvas == "terminal" and not sys.stdout.isatty():
        raise UsageError(f"--canvas terminal: stdout is no terminal{instead}")
    if canvas == "glfw":
        _check_display(instead)


def _check_display(instead: str) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import glfw

            works = glfw.init()
    except ImportError as error:
        raise UsageError(f"--canvas glfw: GLFW cannot be loaded: {error}{instead}") from None
    if not works:
        raise UsageError(f"--canvas glfw: there is no display that windows can be on{instead}")


def _missing(canvas: str) -> str | None:
    """A package that a canvas needs and that is not installed; None if all are."""
    packages = _PACKAGES[canvas]
    return next((name for name in packages if importlib.util.find_spec(name) is None), None)


def _is_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and shell.has_trait("kernel")


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence rendercanvas's log below errors, and a warning about its unawaited coroutine."""
    logger = logging.getLogger("rendercanvas")

    # A filter, because importing rendercanvas sets the level of its log.
    def is_error(record: logging.LogRecord) -> bool:
        return record.levelno >= logging.ERROR

    logger.addFilter(is_error)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "coroutine 'Queue.put' was never awaited")
            yield
    finally:
        logger.removeFilter(is_error)


def _tell(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _say(line: str) -> None:
    sys.stderr.write(f"{line}\n")
