"""Measures the cost of accuracy: one scene with every number of halvings, and the exact answer.

``tune`` measures. ``Report`` holds the rows and recommends the smallest n that meets the scene's
tolerance. ``plot`` draws them.
"""

from __future__ import annotations

import csv
import io
import statistics
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from halfstep.contract.arrays import Bools, Floats
from halfstep.errors import UsageError
from halfstep.frames.frame import Frame, Info
from halfstep.frames.renderer import WARM_UP, Renderer
from halfstep.host.steps import format_for
from halfstep.scene import Accuracy, Scene, with_overrides
from halfstep.tune.choices import Choices
from halfstep.tune.exact import Exact, exact
from halfstep.version import __version__

REPEATS = 5
# The tolerance for a scene that states a number of steps instead of a tolerance.
DEFAULT_TOLERANCE_PIXELS = 0.5


_MEASURED = ("solid", "surface", "depth", "error")


@dataclass(frozen=True)
class Row:
    """One setting and its results. Depths are along the view axis, in scene units.

    Attributes:
        steps: halvings of every solid; in the automatic row, the most of any solid.
        number_format: the number format.
        method: "visible" or "article".
        max_depth_error: largest |depth - exact depth| of the pixels that show the right surface.
        rms_depth_error: root mean square of |depth - exact depth| of these pixels.
        max_error_pixels: largest of these errors in widths of a pixel at that depth.
        max_error_bound: largest finite ``Frame.error`` of the pixels that show the right surface.
        max_bound_pixels: largest of these bounds in widths of a pixel at that depth.
        uncertified_pixels: pixels with an infinite ``Frame.error``, hit or missed.
        wrong_pixels: pixels that show another solid or surface than the exact answer.
        misplaced_pixels: wrong pixels whose depth is off by more than the tolerance, or where only
            one of the two answers is a hit.
        silhouette_pixels: wrong pixels where only one of the two answers is a hit.
        device_ms: median device time of the image alone with one sample in each pixel; None if the
            device has no timestamps.
        wall_ms: median wall time of the same frames, with set-up and readback.
    """

    steps: int
    number_format: str
    method: str
    max_depth_error: float
    rms_depth_error: float
    max_error_pixels: float
    max_error_bound: float
    max_bound_pixels: float
    uncertified_pixels: int
    wrong_pixels: int
    misplaced_pixels: int
    silhouette_pixels: int
    device_ms: float | None = None
    wall_ms: float | None = None


@dataclass(frozen=True)
class Report:
    """The result of ``tune`` for a scene.

    Attributes:
        scene: the scene as it was rendered, with the picture size and the tolerance.
        adapter: name of the adapter that rendered.
        driver: name and version of its driver.
        rows: one row for each method, number format and number of steps.
        recommended: one of the rows.
        meets_tolerance: whether the recommended row meets the scene's tolerance; if no row does,
            the row with the least error is recommended.
        automatic: a row for the steps that ``render`` chooses for each solid.
        automatic_steps: these steps in the order of the scene's solids; 0 for a solid not seen.
        error_pixels: (H, W) float64, |depth - exact depth| at the recommended setting in widths of
            a pixel at that depth; inf in wrong pixels, NaN where both answers are misses.
    """

    scene: Scene
    adapter: str
    driver: str
    rows: tuple[Row, ...]
    recommended: Row
    meets_tolerance: bool
    automatic: Row
    automatic_steps: tuple[int, ...]
    error_pixels: Floats

    def as_dict(self) -> dict[str, Any]:
        """The report without its picture, for JSON."""
        image, accuracy = self.scene.image, self.scene.accuracy
        return {
            "scene": self.scene.name,
            "size": [image.width, image.height],
            "adapter": self.adapter,
            "driver": self.driver,
            "tolerance_pixels": accuracy.tolerance_pixels,
            "tolerance": accuracy.tolerance,
            "rows": [asdict(row) for row in self.rows],
            "recommended": asdict(self.recommended) | {"meets_tolerance": self.meets_tolerance},
            "automatic": asdict(self.automatic) | {"steps_by_solid": list(self.automatic_steps)},
            "scene_sha256": self.scene.sha256,
            "version": __version__,
        }

    def as_table(self) -> str:
        """The rows and the recommendation, for people."""
        image, accuracy = self.scene.image, self.scene.accuracy
        limit = f"{limit_of(accuracy):g} {unit_of(accuracy)}"
        row = self.recommended
        setting = f"{row.steps} steps, {row.method}, {row.number_format}"
        chosen = span([n for n in self.automatic_steps if n])
        error = error_of(self.automatic, accuracy)
        if self.meets_tolerance:
            advice = f"recommended: {setting}, the fewest that meet {limit}"
        else:
            advice = f"nothing meets {limit}; closest: {setting}"
        return "\n".join(
            [
                f"{self.scene.name}, {image.width} x {image.height}, on {self.adapter}",
                "depth errors in scene units and in pixel widths (px), medians of times",
                *_columns(self.rows),
                advice,
                f"chosen for each solid without `steps`: {chosen}, largest error {error:.2g} "
                f"{unit_of(accuracy)}",
            ]
        )

    def as_csv(self) -> str:
        """The rows as CSV with a heading. A time that was not measured is left empty."""
        text = io.StringIO()
        writer = csv.DictWriter(text, [field.name for field in fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in self.rows)
        return text.getvalue()


def tune(
    scene: Scene,
    *,
    size: tuple[int, int] | None = None,
    steps: Iterable[int] | None = None,
    tolerance_pixels: float | None = None,
    tolerance: float | None = None,
    methods: Sequence[str] | None = None,
    formats: Sequence[str] | None = None,
    backend: str = "auto",
    adapter: str | int | None = None,
    repeats: int = REPEATS,
    progress: Callable[[float], None] = lambda _: None,
) -> Report:
    """Measure ``scene`` with every setting.

    If the device has no 64-bit integers in shaders, settings that need them are left out with a
    warning. Of steps, methods and formats that are not given, those that cannot draw the tori or
    formulas of the scene are left out.

    Args:
        scene: the scene to render.
        size: (width, height) in pixels, by default the scene's.
        steps: the numbers of halvings to try, each 1…30; by default 4 to 24.
        tolerance_pixels: the largest acceptable depth error, in widths of a pixel at that depth; by
            default the scene's tolerance, or half a pixel if the scene states steps.
        tolerance: the largest acceptable depth error in scene units, in place of the above.
        methods: the methods to try, by default "visible" and "article".
        formats: the number formats to try, by default both.
        backend: see ``render``.
        adapter: see ``render``.
        repeats: how many frames of each setting are timed.
        progress: is called with the finished part of the work, 0…1.

    Raises:
        SceneError: an option is out of range.
        UsageError: there is nothing to try, or the backend is unknown.
        AdapterError: no adapter is suitable, or the adapter can work with none of the settings.
        DeviceError: the device was lost or the driver failed.
    """
    if repeats < 1:
        raise UsageError(f"repeats: {repeats} is not >= 1")
    scene = with_overrides(
        scene, size=size, samples=1, tolerance_pixels=tolerance_pixels, tolerance=tolerance
    )
    if scene.accuracy.steps is not None:
        scene = with_overrides(scene, tolerance_pixels=DEFAULT_TOLERANCE_PIXELS)
    choices = Choices(scene, methods, formats, steps)
    automatic, settings = choices.automatic(), choices.settings()
    if not settings:
        raise UsageError("there is no number of steps, number format or method to try")
    stated = scene.accuracy
    with Renderer(automatic[0], backend=backend, adapter=adapter) as renderer:
        trials = _Trials(renderer, exact(scene))
        settings = trials.possible(settings)
        everything = [*settings, automatic[0]]
        total = len(everything) * (1 + repeats)
        rows: list[Row] = []
        for setting in everything:
            row, frame = trials.measure(setting, stated)
            rows.append(row)
            progress(len(rows) / total)
        infos = []
        for info in trials.timed(everything, rows, repeats):
            infos.append(info)
            progress((len(rows) + len(infos)) / total)
        chosen_steps = tuple(frame.info["steps"])
        *rows, chosen = [
            replace(
                row,
                device_ms=_median(info.get("device_ms") for info in infos[k :: len(rows)]),
                wall_ms=_median(info["wall_ms"] for info in infos[k :: len(rows)]),
            )
            for k, row in enumerate(rows)
        ]
        recommended, meets = recommend(rows, stated)
        frame = trials.frame(settings[rows.index(recommended)], _MEASURED)
        return Report(
            scene=scene,
            adapter=frame.info["adapter"],
            driver=frame.info["driver"],
            rows=tuple(rows),
            recommended=recommended,
            meets_tolerance=meets,
            automatic=chosen,
            automatic_steps=chosen_steps,
            error_pixels=trials.error_pixels(frame),
        )


def recommend(rows: Sequence[Row], accuracy: Accuracy) -> tuple[Row, bool]:
    """The row to use for the tolerance of ``accuracy``, and whether it meets the tolerance.

    ``rows`` are sorted by steps. The first row is taken that meets the tolerance and misplaces no
    more pixels than the same method and number format with the most steps. If no row does, the row
    with the least error is taken.
    """
    floor = {(row.number_format, row.method): row.misplaced_pixels for row in rows}
    for row in rows:
        few = row.misplaced_pixels <= floor[row.number_format, row.method]
        if few and error_of(row, accuracy) <= limit_of(accuracy):
            return row, True
    return min(rows, key=lambda row: error_of(row, accuracy)), False


def error_of(row: Row, accuracy: Accuracy) -> float:
    """The largest depth error of ``row``, in the unit of the tolerance of ``accuracy``."""
    return row.max_depth_error if accuracy.tolerance_pixels is None else row.max_error_pixels


def limit_of(accuracy: Accuracy) -> float:
    """The tolerance of ``accuracy``, in pixel widths or in scene units."""
    limit = accuracy.tolerance if accuracy.tolerance_pixels is None else accuracy.tolerance_pixels
    assert limit is not None  # `tune` states a tolerance if the scene does not
    return limit


def unit_of(accuracy: Accuracy) -> str:
    """The unit of the tolerance of ``accuracy``."""
    return "scene units" if accuracy.tolerance_pixels is None else "pixel widths"


def span(steps: Sequence[int]) -> str:
    """The least and the most of ``steps`` in words."""
    if not steps:
        return "nothing is seen"
    low, high = min(steps), max(steps)
    return f"{low} steps" if low == high else f"{low} to {high} steps"


def _columns(rows: Iterable[Row]) -> list[str]:
    """The lines of a table with right-aligned columns."""
    cells: list[tuple[str, ...]] = [
        (
            *("steps", "format", "method", "max error", "rms error", "max px", "bound px"),
            *("uncertified", "wrong", "misplaced", "silhouette", "device ms", "wall ms"),
        )
    ]
    for row in rows:
        errors = (
            row.max_depth_error,
            row.rms_depth_error,
            row.max_error_pixels,
            row.max_bound_pixels,
        )
        counts = (
            row.uncertified_pixels,
            row.wrong_pixels,
            row.misplaced_pixels,
            row.silhouette_pixels,
        )
        times = ("-" if time is None else f"{time:.2f}" for time in (row.device_ms, row.wall_ms))
        numbers = (*(f"{error:.3g}" for error in errors), *map(str, counts), *times)
        cells.append((str(row.steps), row.number_format, row.method, *numbers))
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        for line in cells
    ]


@dataclass(frozen=True)
class _Trials:
    """Renders one scene with many settings, and compares the frames with the exact answer."""

    renderer: Renderer
    exact: Exact

    def frame(self, setting: Scene, outputs: Iterable[str]) -> Frame:
        """The frame of ``setting``, the scene with some accuracy."""
        return self.renderer.render_prepared(self.renderer.prepare(setting, outputs=outputs))

    @cached_property
    def pixel_width(self) -> Floats:
        """Widths (H, W) of a pixel at the exact depth, scene units; NaN where nothing is hit."""
        depth, view = self.exact.depth, self.exact.view
        at = np.where(np.isnan(depth), depth, 1.0) if view.parallel else depth
        return np.asarray(view.pixel * at)

    def possible(self, settings: list[Scene]) -> list[Scene]:
        """The ``settings`` that the device can work with, or all of them if it can with none."""
        most = self.renderer.most_steps
        if most is None:
            return settings
        kept = [
            setting
            for setting in settings
            if not format_for(setting.accuracy, setting.accuracy.steps or 0).integer
        ]
        if not kept or len(kept) == len(settings):
            return settings
        warnings.warn(
            f"{len(settings) - len(kept)} of {len(settings)} settings are left out: fixed32 and "
            f"more than {most} steps need 64-bit integers in shaders, which this "
            "adapter lacks",
            stacklevel=3,
        )
        return kept

    def measure(self, setting: Scene, stated: Accuracy) -> tuple[Row, Frame]:
        """The row of ``setting``, without times, and its frame. ``stated`` has the tolerance."""
        frame = self.frame(setting, _MEASURED)
        wrong = self.wrong(frame)
        right = (frame.solid >= 0) & ~wrong
        one_hits = (frame.solid < 0) != (self.exact.solid < 0)
        error, width = np.abs(frame.depth - self.exact.depth), self.pixel_width
        bounded = np.isfinite(frame.error) & right
        unit = 1.0 if stated.tolerance_pixels is None else width
        misplaced = wrong & ~(error <= limit_of(stated) * unit)
        row = Row(
            steps=setting.accuracy.steps or max(frame.info["steps"], default=0),
            number_format=setting.accuracy.number_format,
            method=setting.accuracy.method,
            max_depth_error=_largest(error[right]),
            rms_depth_error=float(np.sqrt((error[right] ** 2).sum() / max(right.sum(), 1))),
            max_error_pixels=_largest((error / width)[right]),
            max_error_bound=_largest(frame.error[bounded]),
            max_bound_pixels=_largest((frame.error / width)[bounded]),
            uncertified_pixels=int(np.isinf(frame.error).sum()),
            wrong_pixels=int(wrong.sum()),
            misplaced_pixels=int(misplaced.sum()),
            silhouette_pixels=int(one_hits.sum()),
        )
        return row, frame

    def wrong(self, frame: Frame) -> Bools:
        """Pixels (H, W) that show another solid or surface than the exact answer."""
        return (frame.solid != self.exact.solid) | (frame.surface != self.exact.surface)

    def error_pixels(self, frame: Frame) -> Floats:
        """``Report.error_pixels`` of ``frame``."""
        error = np.abs(frame.depth - self.exact.depth) / self.pixel_width
        return np.where(self.wrong(frame), np.inf, error)

    def timed(self, settings: Sequence[Scene], rows: Sequence[Row], repeats: int) -> Iterator[Info]:
        """``Frame.info`` of an image with every setting in turn, ``repeats`` times over."""
        # The first frames with a shader compile it, so they are not timed.
        shaders = {
            (format_for(setting.accuracy, row.steps), row.method): setting
            for row, setting in zip(rows, settings, strict=True)
        }
        for setting in [*shaders.values()] * WARM_UP:
            self.frame(setting, ("image",))
        for _ in range(repeats):
            for setting in settings:
                yield self.frame(setting, ("image",)).info


def _largest(values: Floats) -> float:
    return float(values.max(initial=0.0))


def _median(times: Iterable[float | None]) -> float | None:
    known = [time for time in times if time is not None]
    return statistics.median(known) if known else None
