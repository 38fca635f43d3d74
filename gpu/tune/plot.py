"""Draws the report of ``tune``: curves by Matplotlib, and a map of the errors."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from halfstep.contract.arrays import Bytes
from halfstep.errors import UsageError
from halfstep.files.inferno import inferno
from halfstep.files.whole import check_output_folder, write_file
from halfstep.frames.png import png
from halfstep.scene import Accuracy
from halfstep.tune.measure import Report, Row, error_of, limit_of, span, unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_WRONG = (0, 230, 230)
_NOTHING = (52, 58, 66)
# The map's scale spans this many powers of ten, up to the first that no error exceeds.
_DECADES = 4
_LEGEND_WIDTH = 460
_LEGEND_HEIGHT = 76

# Squares and diamonds are hollow, so that dots in the same place stay visible.
_STYLES: dict[tuple[str, str], dict[str, Any]] = {
    ("visible", "float32"): {"color": "#0b5fa5", "marker": "o", "markersize": 4, "zorder": 3},
    ("visible", "fixed32"): {"color": "#12866b", "marker": "^", "markersize": 4, "zorder": 3},
    ("article", "float32"): {
        "color": "#c4500a",
        "marker": "s",
        "markersize": 7,
        "markerfacecolor": "none",
    },
    ("article", "fixed32"): {
        "color": "#9a4fa3",
        "marker": "D",
        "markersize": 7,
        "markerfacecolor": "none",
    },
}


def write(report: Report, folder: str | os.PathLike[str]) -> list[str]:
    """Write tune.csv, tune.json and error.png in ``folder``, and tune.png if Matplotlib is there.

    Returns the names of the files.

    Raises:
        UsageError: the folder cannot be made or written to.
        HalfstepError: the system refuses to write, as on a full disk.
    """
    check_output_folder(folder)
    place = Path(folder)
    files = {
        "tune.csv": report.as_csv().encode(),
        "tune.json": (json.dumps(report.as_dict(), indent=2) + "\n").encode(),
        "error.png": png(error_map(report)),
    }
    with contextlib.suppress(ImportError):
        files["tune.png"] = curves(report)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: {error.strerror}") from error
    for name, data in files.items():
        write_file(place / name, data)
    return list(files)


def curves(report: Report) -> bytes:
    """A PNG file with three plots: error against n, time against n, and error against time.

    Raises:
        ImportError: Matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 7.2), dpi=110, layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.1))
    error, time = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    _draw_errors(error, report)
    _draw_times(time, report)
    _draw_trade(figure.add_subplot(grid[:, 1]), report)
    image = report.scene.image
    figure.suptitle(
        f"{_plain(report.scene.name)}, {image.width} × {image.height}: {_plain(report.adapter)}"
    )
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    return file.getvalue()


def _draw_errors(axes: Axes, report: Report) -> None:
    accuracy = report.scene.accuracy
    pixels = accuracy.tolerance_pixels is not None
    for setting, rows in _by_setting(report).items():
        n, style = [row.steps for row in rows], _STYLES[setting]
        errors = [error_of(row, accuracy) for row in rows]
        axes.plot(n, errors, linewidth=1.4, label=f"{_name(setting)}: largest error", **style)
        bound = [row.max_bound_pixels if pixels else row.max_error_bound for row in rows]
        label = f"{_name(setting)}: guaranteed bound"
        axes.plot(n, bound, linestyle=":", linewidth=1.4, color=style["color"], label=label)
    limit = limit_of(accuracy)
    axes.axhline(limit, color="0.25", linestyle="--", linewidth=1, label=f"tolerance {limit:g}")
    _ring(axes, report.recommended.steps, error_of(report.recommended, accuracy))
    axes.set_yscale("log")
    axes.set_ylabel(_error_label(report))
    _finish_steps(axes)


def _draw_times(axes: Axes, report: Report) -> None:
    for setting, rows in _by_setting(report).items():
        n, times = [row.steps for row in rows], [_time(row) for row in rows]
        axes.plot(n, times, linewidth=1.4, label=_name(setting), **_STYLES[setting])
    solids = [n for n in report.automatic_steps if n]
    if solids:
        axes.axhline(
            _time(report.automatic),
            color="0.25",
            linestyle="-.",
            linewidth=1,
            label=f"automatic: {span(solids)}, by solid",
        )
    _ring(axes, report.recommended.steps, _time(report.recommended))
    axes.set_ylim(bottom=0)
    axes.set_ylabel(_time_label(report))
    _finish_steps(axes)


def _draw_trade(axes: Axes, report: Report) -> None:
    accuracy = report.scene.accuracy
    for setting, rows in _by_setting(report).items():
        times, errors = [_time(row) for row in rows], [error_of(row, accuracy) for row in rows]
        axes.plot(times, errors, linestyle="none", label=_name(setting), **_STYLES[setting])
    front = pareto([(_time(row), error_of(row, accuracy)) for row in report.rows])
    rows = [report.rows[k] for k in front]
    axes.step(
        [_time(row) for row in rows],
        [error_of(row, accuracy) for row in rows],
        where="post",
        color="0.45",
        linewidth=1,
        label="Pareto frontier (numbers are n)",
    )
    axes.plot(
        _time(report.automatic),
        error_of(report.automatic, accuracy),
        color="0.25",
        marker="D",
        markersize=6,
        linestyle="none",
        label="automatic: an n for each solid",
    )
    axes.axhline(limit_of(accuracy), color="0.25", linestyle="--", linewidth=1, label="tolerance")
    _ring(axes, _time(report.recommended), error_of(report.recommended, accuracy))
    axes.set_yscale("log")
    axes.set_xlim(left=0)
    axes.set_xlabel(_time_label(report))
    axes.set_ylabel(_error_label(report))
    _finish(axes)
    _number(axes, [report.recommended, *rows], accuracy)


def _number(axes: Axes, rows: Sequence[Row], accuracy: Accuracy) -> None:
    """Write n beside points in the order of ``rows``, unless it would cover another n.

    The first number stands lower, clear of the ring around its point.
    """
    written: list[tuple[float, float]] = []
    for row in rows:
        point = _time(row), error_of(row, accuracy)
        x, y = axes.transData.transform(point)
        if all(abs(x - p) > 24 or abs(y - q) > 16 for p, q in written):
            axes.annotate(
                f"{row.steps}",
                point,
                textcoords="offset points",
                xytext=(8, 4) if written else (8, -14),
                fontsize=8,
            )
            written.append((x, y))


def pareto(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other point beats in both coordinates, sorted by the first."""
    front: list[int] = []
    for k in sorted(range(len(points)), key=lambda k: points[k]):
        if not front or points[k][1] < points[front[-1]][1]:
            front.append(k)
    return front


def _by_setting(report: Report) -> dict[tuple[str, str], list[Row]]:
    rows: dict[tuple[str, str], list[Row]] = {}
    for row in report.rows:
        rows.setdefault((row.method, row.number_format), []).append(row)
    return rows


def _name(setting: tuple[str, str]) -> str:
    return ", ".join(setting)


def _time(row: Row) -> float:
    """Device time in ms, or wall time if the device has no timestamps."""
    time = row.wall_ms if row.device_ms is None else row.device_ms
    return math.nan if time is None else time


def _time_label(report: Report) -> str:
    clock = "wall" if report.recommended.device_ms is None else "device"
    return f"{clock} time of a frame (ms)"


def _error_label(report: Report) -> str:
    return f"depth error ({unit_of(report.scene.accuracy)})"


def _ring(axes: Axes, x: float, y: float) -> None:
    axes.plot(
        x,
        y,
        marker="o",
        markersize=13,
        markerfacecolor="none",
        markeredgecolor="#1a8a3a",
        markeredgewidth=2.2,
        linestyle="none",
        label="recommended",
        zorder=5,
    )


def _finish_steps(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("n, halvings of each ray and solid")
    _finish(axes)


def _finish(axes: Axes) -> None:
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    axes.legend(
        fontsize=8,
        frameon=False,
        ncols=2,
        loc="lower left",
        bbox_to_anchor=(0, 1),
        borderaxespad=0.2,
        columnspacing=1.0,
        handlelength=1.6,
        markerscale=0.7,
    )


def _plain(name: str) -> str:
    """``name`` with escaped dollars: Matplotlib reads text between dollars as mathematics."""
    return name.replace("$", r"\$")


def scale_of(report: Report) -> tuple[float, float]:
    """Errors in pixel widths at the dark and the bright end of the map's colours, powers of ten."""
    error_pixels = report.error_pixels
    errors = error_pixels[np.isfinite(error_pixels)]
    largest = float(errors.max(initial=0.0))
    high = 10.0 ** math.ceil(math.log10(largest)) if largest > 0 else 1.0
    return high / 10**_DECADES, high


def error_map(report: Report) -> Bytes:
    """A map (H + legend, W, 3) of ``Report.error_pixels`` in colours of a logarithmic scale.

    A map narrower than the legend is placed at the left.
    """
    errors = report.error_pixels
    low, _ = scale_of(report)
    hit = np.isfinite(errors)
    place = np.log10(np.maximum(np.where(hit, errors, low), low) / low) / _DECADES
    picture = inferno(place)
    picture[np.isnan(errors)] = _NOTHING
    picture[np.isposinf(errors)] = _WRONG
    height, width = errors.shape
    canvas = Image.new("RGB", (max(width, _LEGEND_WIDTH), height + _LEGEND_HEIGHT), (18, 18, 20))
    canvas.paste(Image.fromarray(picture), (0, 0))
    _draw_legend(canvas, height, report, low)
    return np.asarray(canvas)


def _draw_legend(canvas: Image.Image, top: int, report: Report, low: float) -> None:
    draw = ImageDraw.Draw(canvas)
    font, white = ImageFont.load_default(12), (235, 235, 235)
    row = report.recommended
    draw.text(
        (12, top + 6),
        f"depth error in pixel widths, n = {row.steps}, {row.method}, {row.number_format}",
        white,
        font,
    )
    left, width = 12, 264
    bar = np.broadcast_to(inferno(np.linspace(0, 1, width)), (14, width, 3))
    canvas.paste(Image.fromarray(np.ascontiguousarray(bar)), (left, top + 30))
    draw.rectangle((left - 1, top + 29, left + width, top + 44), outline=(110, 110, 110))
    for decade in range(_DECADES + 1):
        x = left + round(decade * (width - 1) / _DECADES)
        draw.line((x, top + 45, x, top + 49), white)
        anchor = {0: "la", _DECADES: "ra"}.get(decade, "ma")
        draw.text((x, top + 52), f"{low * 10**decade:.3g}", white, font, anchor=anchor)
    for color, text, y in ((_WRONG, "another surface", 27), (_NOTHING, "nothing there", 49)):
        draw.rectangle((314, top + y, 328, top + y + 14), fill=color, outline=(110, 110, 110))
        draw.text((336, top + y), text, white, font)
