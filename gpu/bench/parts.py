"""The parts of the benchmark: each is a function that measures and returns a table."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial

from halfstep.bench import machine, povray, scenes
from halfstep.bench.cold import medians
from halfstep.bench.native import FLAGS, LANES, Native, NoCompilerError
from halfstep.bench.report import Part, Value
from halfstep.bench.timing import Case, Times, interleaved, line
from halfstep.contract.formats import FIXED32, FLOAT32, FLOAT_STEPS
from halfstep.device.adapters import INT64, Adapter
from halfstep.errors import HalfstepError
from halfstep.frames.renderer import WARM_UP, Renderer
from halfstep.run.backend import Backend
from halfstep.run.gpu import Device
from halfstep.scene import Scene, load, with_overrides

_SIZE = (1024, 1024)
_HALVINGS = (4, 8, 12, 16)
_STEPS = (2, 4, 6, 8, 10, 12, 14, 16, 20, 24)
_SIDES = (256, 512, 1024, 2048)
_LATTICES = (10, 100, 1000, 5000, 100_000)
_SET_UP = (100, 1000, 10_000)
_SHADOWED = ("figure", "gallery", "crowd", "bracket")  # the last one has cells
_MIRRORING = ("figure", "gallery", "crowd")
_SMALL = (256, 256)
_REGIONS = ("die", "bracket", "nut_and_bolt", "assembly_17x17")
_PINS = (17, 100, 316)
_RINGS = 15
_REGION_STEPS = 12
_LACKING = "64-bit integers in shaders, which this adapter lacks."


@dataclass(frozen=True)
class Bench:
    """The adapter and options that all parts share."""

    adapter: Adapter
    rounds: int
    progress: Callable[[float], None] = lambda _: None

    @contextmanager
    def renderer(
        self,
        scene: Scene,
        *,
        output: str = "image",
        backend: str | Backend = "gpu",
    ) -> Iterator[Renderer]:
        """A renderer of ``scene`` with one output."""
        index = self.adapter.summary.index
        with Renderer(scene, outputs=(output,), backend=backend, adapter=index) as renderer:
            yield renderer

    def times(
        self,
        cases: Mapping[Case, Callable[[], float | None]],
        *,
        times: int = 1,
        turn: float = 0.0,
    ) -> dict[Case, Times]:
        """Median times of ``cases`` over ``times`` times the rounds, in turns of ``turn`` ms."""
        return interleaved(cases, times * self.rounds, self.progress, turn=turn)

    @property
    def on_processor(self) -> bool:
        """Whether the device is a software adapter."""
        return self.adapter.summary.kind == "cpu"


def _frame(renderer: Renderer, scene: Scene) -> float | None:
    """Render a frame, and return its device time in ms if measured."""
    return renderer.render(scene).info.get("device_ms")


def _row(times: Times) -> dict[str, Value]:
    return {"device ms": times.device, "wall ms": times.wall}


def halving(bench: Bench) -> Part:
    """The cost of one halving of one ray on one solid, in both number formats, against C."""
    scene = scenes.covering()
    side = 4 * LANES if bench.on_processor else 32 * LANES
    size = side, side
    threads = machine.threads()
    notes: list[str] = []
    with bench.renderer(scene, output="solid") as renderer:
        forms = [FLOAT32.name]
        if renderer.most_steps is None:
            forms.append(FIXED32.name)
        else:
            notes.append(f"Left out: fixed32, which needs {_LACKING}")
        cases: dict[tuple[str, int], Callable[[], float | None]] = {
            (form, n): partial(
                _frame, renderer, with_overrides(scene, size=size, steps=n, number_format=form)
            )
            for form in forms
            for n in _HALVINGS
        }
        try:
            native = Native(scene, size, threads)
        except NoCompilerError as error:
            notes.append(f"Not compared with C: {error}.")
        else:
            cases |= {("C", n): partial(native.run, n) for n in _HALVINGS}
            notes.append(f"C: {native.compiler} {' '.join(FLAGS)}, {threads} threads.")
        # The result is a difference of nearly equal times, so it needs more rounds.
        times = bench.times(cases, times=4, turn=20.0)
    unit = 1e6 / (size[0] * size[1] * len(scene.solids))
    fits = {
        where: line(_HALVINGS, [times[where, n].best * unit for n in _HALVINGS])
        for where in dict.fromkeys(where for where, _ in cases)
    }
    rows: list[dict[str, Value]] = [
        {
            "where": where,
            "ns per halving": fit.slope,
            "against C": fit.slope / fits["C"].slope if "C" in fits else None,
            "ns for the rest": fit.intercept,
            "R²": fit.r_squared,
        }
        for where, fit in fits.items()
    ]
    found = f"{rows[0]['ns per halving']:.3f} ns"
    if "C" in fits:
        found += f", {fits[FLOAT32.name].slope / fits['C'].slope:.2f} × C"
    summary = {"one halving of one ray on one solid": found}
    if FIXED32.name in fits:
        ratio = fits[FIXED32.name].slope / fits[FLOAT32.name].slope
        summary["the same in fixed32, against float32"] = f"{ratio:.2f} ×"
    title = f"One halving of one ray on one solid: {len(scene.solids)} solids that all rays meet"
    return Part("halving", title, rows, summary, notes=notes)


def steps(bench: Bench) -> Part:
    """Frame time against n, the number of halvings."""
    scene = with_overrides(scenes.overlapping(), size=_SIZE)
    with bench.renderer(scene) as renderer:
        counts = [n for n in _STEPS if n <= (renderer.most_steps or n)]
        cases = {n: partial(_frame, renderer, with_overrides(scene, steps=n)) for n in counts}
        # A halving takes a hundredth of a frame, so the fit needs more rounds.
        times = bench.times(cases, times=8)
    rows: list[dict[str, Value]] = [{"n": n, **_row(times[n])} for n in counts]
    direct = [n for n in counts if n <= FLOAT_STEPS]
    notes = [] if counts == [*_STEPS] else [f"Left out: n that need {_LACKING}"]
    fit = line(direct, [times[n].best for n in direct])
    return Part(
        "steps",
        f"A frame against n, {_scene_and_size(scene)}",
        rows,
        {f"time against n, {_scene_and_size(scene)}": f"R² = {fit.r_squared:.4f}"},
        {f"ms against n, to {FLOAT_STEPS}": fit},
        notes,
    )


def closed(bench: Bench) -> Part:
    """The whole frame against the same pipeline with closed-form roots."""
    rows: list[dict[str, Value]] = []
    with ExitStack() as stack:
        cases: dict[tuple[int, str], Callable[[], float | None]] = {}
        for scene in (scenes.overlapping(), scenes.equal_coverage(1000)):
            for roots in ("halvings", "closed form"):
                # The stage `closed` runs in the product's own pipeline, with the same positions.
                conveyor = "conveyor" if roots == "halvings" else "closed"
                device = Device(bench.adapter, conveyor=conveyor)
                renderer = stack.enter_context(bench.renderer(scene, backend=device))
                shown = with_overrides(scene, size=_SIZE)
                for _ in range(WARM_UP):
                    _frame(renderer, shown)
                cases[len(scene.solids), roots] = partial(_frame, renderer, shown)
        times = bench.times(cases, times=4)
    for count in dict.fromkeys(count for count, _ in cases):
        own, other = times[count, "halvings"], times[count, "closed form"]
        rows.append(
            {
                "solids": count,
                "halvings, device ms": own.device,
                "closed form, device ms": other.device,
                "ratio": own.best / other.best,
            }
        )
    summary = {
        f"{row['solids']:,} solids, {_named(_SIZE)}, against closed-form roots": (
            f"{row['halvings, device ms']:.1f} ms, {row['ratio']:.2f} ×"
        )
        for row in rows
    }
    title = f"Frames at default accuracy with halvings and with closed-form roots, {_named(_SIZE)}"
    return Part("closed", title, rows, summary)


def twin(bench: Bench) -> Part:
    """Frame time on the device against the twin in NumPy."""
    scene = with_overrides(scenes.overlapping(), size=_SMALL)
    with ExitStack() as stack:
        cases: dict[str, Callable[[], float | None]] = {
            backend: partial(
                _frame, stack.enter_context(bench.renderer(scene, backend=backend)), scene
            )
            for backend in ("gpu", "numpy")
        }
        times = bench.times(cases)
    rows: list[dict[str, Value]] = [
        {"backend": name, "wall ms": own.wall, "ratio": own.wall / times["gpu"].wall}
        for name, own in times.items()
    ]
    found = {f"NumPy, {_scene_and_size(scene)}": f"{times['numpy'].wall / times['gpu'].wall:.1f} ×"}
    return Part("twin", f"NumPy, {_scene_and_size(scene)}", rows, found)


def pov(bench: Bench) -> Part:
    """Frame time against POV-Ray's for the same picture."""
    scene = with_overrides(scenes.overlapping(), size=_SIZE)
    title = f"POV-Ray, the same picture, {_scene_and_size(scene)}"
    try:
        version = povray.version()
    except povray.NoPovrayError as error:
        return Part("povray", title, [], notes=[f"Left out: {error}."])
    with bench.renderer(scene) as renderer:
        times = bench.times(
            {
                "halfstep": partial(_frame, renderer, scene),
                "povray": lambda: povray.trace_time(scene, _SIZE, machine.threads()),
            },
            # POV-Ray takes about this long for one picture, and runs in another process.
            turn=200.0,
        )
    own, traced = times["halfstep"].wall, times["povray"].best
    rows: list[dict[str, Value]] = [
        {"program": "halfstep, image on the host", "ms": own, "ratio": 1.0},
        {"program": f"{version}, its trace time", "ms": traced, "ratio": traced / own},
    ]
    what = f"POV-Ray's trace time, {_scene_and_size(scene)}"
    return Part("povray", title, rows, {what: f"{traced / own:.1f} ×"})


def regions(bench: Bench) -> Part:
    """Frames of cells and copies of groups, against POV-Ray on the same solid geometry."""
    chosen = {
        name: with_overrides(load(name), size=_SIZE, steps=_REGION_STEPS) for name in _REGIONS
    }
    for side in _PINS:
        scene = with_overrides(scenes.pins(side), size=_SIZE, steps=_REGION_STEPS)
        chosen[f"{side * side:,} pins"] = scene
    # Each ray of POV-Ray tries all cylinders, so that it takes minutes.
    alone = f"outside of {1 + 3 * _RINGS * (_RINGS + 1)} cylinders"
    scene = scenes.channels(_RINGS)
    chosen[alone] = with_overrides(scene, size=_SIZE, steps=_REGION_STEPS)
    notes: list[str] = []
    try:
        notes.append(f"{povray.version()}: its trace time, without parsing.")
    except povray.NoPovrayError as error:
        notes.append(f"Not compared with POV-Ray: {error}.")
    is_there = not notes[0].startswith("Not")
    with ExitStack() as stack:
        cases: dict[tuple[str, str], Callable[[], float | None]] = {}
        for name, scene in chosen.items():
            renderer = stack.enter_context(bench.renderer(scene))
            cases[name, "frame"] = partial(_frame, renderer, scene)
            cases[name, "set-up"] = partial(_prepared, renderer)
            if is_there and name != alone:
                traced = partial(povray.trace_time, scene, _SIZE, machine.threads())
                cases[name, "POV-Ray"] = traced
        times = bench.times(cases)
    rows: list[dict[str, Value]] = []
    summary = {}
    for name in chosen:
        own = times[name, "frame"]
        by_povray = times.get((name, "POV-Ray"))
        traced_ms = None if by_povray is None else by_povray.best
        rows.append(
            {
                "scene": name,
                **_row(own),
                "constants, ms": times[name, "set-up"].wall,
                "POV-Ray ms": traced_ms,
                "ratio": traced_ms / own.wall if traced_ms else None,
            }
        )
        beside = f", POV-Ray {traced_ms / own.wall:.1f} ×" if traced_ms else ""
        summary[f"{name}, {_named(_SIZE)}, image on the host"] = f"{own.wall:.0f} ms{beside}"
    title = f"Cells and copies of groups, {_named(_SIZE)}, {_REGION_STEPS} halvings"
    return Part("regions", title, rows, summary, notes=notes)


def formulas(bench: Bench) -> Part:
    """Frames of tori and formulas, against POV-Ray's own shapes."""
    size = 640, 480
    given = {
        "torus": (scenes.torus(), "torus"),
        "cubic": (scenes.cubic(), "poly"),
        "torus of roots": (scenes.torus_of_roots(), "isosurface"),
        "gyroid": (scenes.gyroid(), "isosurface"),
    }
    title = f"Tori and formulas, {_named(size)}"
    notes: list[str] = []
    try:
        notes.append(f"{povray.version()}: its trace time.")
        is_there = True
    except povray.NoPovrayError as error:
        notes.append(f"Not compared with POV-Ray: {error}.")
        is_there = False
    with ExitStack() as stack:
        cases: dict[tuple[str, str], Callable[[], float | None]] = {}
        for name, (scene, _) in given.items():
            sized = with_overrides(scene, size=size, steps=12)
            renderer = stack.enter_context(bench.renderer(sized))
            cases["halfstep", name] = partial(_frame, renderer, sized)
            if is_there:
                cases["povray", name] = partial(povray.trace_time, sized, size, machine.threads())
        times = bench.times(cases, turn=100.0)
    rows: list[dict[str, Value]] = []
    summary: dict[str, str] = {}
    for name, (_, kind) in given.items():
        own = times["halfstep", name]
        row: dict[str, Value] = {"what": name, **_row(own)}
        found = f"{own.wall:.1f} ms"
        if is_there:
            traced = times["povray", name].best
            row |= {"POV-Ray": kind, "its ms": traced, "ratio": traced / own.wall}
            found += f", POV-Ray's {kind} {traced / own.wall:.1f} ×"
        rows.append(row)
        summary[f"{name}, {_named(size)}"] = found
    return Part("formulas", title, rows, summary, notes=notes)


def solids(bench: Bench) -> Part:
    """Frame time against the number of solids, whose total area stays the same."""
    with ExitStack() as stack:
        cases: dict[int, Callable[[], float | None]] = {}
        for count in _LATTICES:
            scene = with_overrides(scenes.equal_coverage(count), size=_SIZE)
            cases[count] = partial(_frame, stack.enter_context(bench.renderer(scene)), scene)
        times = bench.times(cases)
    least = times[_LATTICES[0]].wall
    rows: list[dict[str, Value]] = [
        {"solids": count, **_row(own), "ratio of wall times": own.wall / least}
        for count, own in times.items()
    ]
    summary = {
        f"{count:,} solids against {_LATTICES[0]} of the same area, {_named(_SIZE)}": (
            f"{own.wall:.0f} ms, {own.wall / least:.1f} ×"
        )
        for count, own in times.items()
        if count >= 1000
    }
    return Part("solids", f"Solids that cover an equal area, {_named(_SIZE)}", rows, summary)


def setup(bench: Bench) -> Part:
    """The host's time for a frame, from the camera to the records that the device reads."""
    with ExitStack() as stack:
        cases: dict[int, Callable[[], float | None]] = {}
        for count in _SET_UP:
            renderer = stack.enter_context(bench.renderer(scenes.mixed(count)))
            cases[count] = partial(_prepared, renderer)
        times = bench.times(cases, turn=50.0)
    rows: list[dict[str, Value]] = [
        {"solids": count, "wall ms": own.wall} for count, own in times.items()
    ]
    most = _SET_UP[-1]
    summary = {f"set-up of {most:,} solids of all kinds": f"{times[most].wall:.1f} ms"}
    return Part("setup", "The host's set-up of a frame, solids of all kinds", rows, summary)


def _prepared(renderer: Renderer) -> None:
    renderer.prepare()


def pixels(bench: Bench) -> Part:
    """Frame time against the number of pixels."""
    scene = scenes.overlapping()
    with bench.renderer(scene) as renderer:
        times = bench.times(
            {
                side: partial(_frame, renderer, with_overrides(scene, size=(side, side)))
                for side in _SIDES
            }
        )
    rows: list[dict[str, Value]] = [
        {"size": _named((side, side)), "megapixels": side * side / 1e6, **_row(times[side])}
        for side in _SIDES
    ]
    fit = line([side * side / 1e6 for side in _SIDES], [times[side].best for side in _SIDES])
    title = f"A frame against pixels, {len(scene.solids)} solids"
    summary = {"time against pixels": f"R² = {fit.r_squared:.4f}"}
    return Part("pixels", title, rows, summary, {"ms against megapixels": fit})


def frames(bench: Bench) -> Part:
    """Frame time of bundled scenes, from the request to the image on the host."""
    with ExitStack() as stack:
        cases: dict[str, Callable[[], float | None]] = {}
        for name in ("figure", "gallery", "crowd"):
            scene = with_overrides(load(name), size=(640, 480))
            cases[name] = partial(_frame, stack.enter_context(bench.renderer(scene)), scene)
        times = bench.times(cases)
    rows: list[dict[str, Value]] = [
        {"scene": name, **_row(own), "frames/s": 1e3 / own.wall} for name, own in times.items()
    ]
    summary = {
        f"{name}, 640×480, image on the host": f"{1e3 / own.wall:.0f} frames/s"
        for name, own in times.items()
    }
    return Part("frames", "Bundled scenes, 640×480", rows, summary)


def shadows(bench: Bench) -> Part:
    """Frame time of bundled scenes with and without shadows, and POV-Ray's with shadows."""
    title = "Shadows, 640×480, n = 16"
    if INT64 not in bench.adapter.handle.features:
        return Part("shadows", title, [], notes=[f"Left out: shadows need {_LACKING}"])
    scene = with_overrides(scenes.overlapping(), size=_SIZE, shadows=True)
    given = {"16 solids": scene}
    notes: list[str] = []
    with ExitStack() as stack:
        cases: dict[tuple[str, str], Callable[[], float | None]] = {}
        for name in _SHADOWED:
            for what in ("without", "with"):
                # Both frames use the number of halvings that shadows use.
                drawn = with_overrides(
                    load(name), size=(640, 480), steps=FLOAT_STEPS, shadows=what == "with"
                )
                renderer = stack.enter_context(bench.renderer(drawn))
                cases[name, what] = partial(_frame, renderer, drawn)
            given[name] = drawn
        own = stack.enter_context(bench.renderer(scene))
        cases["16 solids", "with"] = partial(_frame, own, scene)
        for name, drawn in given.items() if _has_povray(notes) else ():
            size = (drawn.image.width, drawn.image.height)
            cases[name, "by POV-Ray"] = partial(povray.trace_time, drawn, size, machine.threads())
        times = bench.times(cases, turn=50.0)
    rows: list[dict[str, Value]] = [
        {"scene": name, "shadows": what, **_row(each)} for (name, what), each in times.items()
    ]
    summary = {
        f"{name}, 640×480, with shadows, against none": (
            f"{times[name, 'with'].best / times[name, 'without'].best:.1f} ×"
        )
        for name in _SHADOWED
    }
    for name, drawn in given.items():
        if (name, "by POV-Ray") in times:
            ratio = times[name, "by POV-Ray"].best / times[name, "with"].wall
            what = _scene_and_size(scene) if drawn is scene else f"{name}, 640×480"
            summary[f"POV-Ray's trace time with shadows, {what}"] = f"{ratio:.1f} ×"
    return Part("shadows", title, rows, summary, notes=notes)


def mirrors(bench: Bench) -> Part:
    """Frame time of bundled scenes without mirrors and with one bounce, and POV-Ray's with it."""
    notes = ["A bounce: what the frame takes longer, against the frame without."]
    is_there = _has_povray(notes)
    size = (640, 480)
    with ExitStack() as stack:
        cases: dict[tuple[str, str], Callable[[], float | None]] = {}
        for name in _MIRRORING:
            plain = with_overrides(load(name), size=size)
            mirrored = scenes.mirroring(plain)
            for what, drawn in (("without", plain), ("with", mirrored)):
                renderer = stack.enter_context(bench.renderer(drawn))
                cases[name, what] = partial(_frame, renderer, drawn)
            if is_there:
                traced = partial(povray.trace_time, mirrored, size, machine.threads())
                cases[name, "by POV-Ray"] = traced
        times = bench.times(cases, turn=50.0)
    rows: list[dict[str, Value]] = [
        {"scene": name, "mirrors": what, **_row(each)} for (name, what), each in times.items()
    ]
    summary = {
        f"{name}, 640×480, a bounce of the whole picture, against the rest": (
            f"{times[name, 'with'].best / times[name, 'without'].best - 1:.1f} ×"
        )
        for name in _MIRRORING
    }
    for name in _MIRRORING if is_there else ():
        ratio = times[name, "by POV-Ray"].best / times[name, "with"].wall
        summary[f"POV-Ray's trace time with mirrors, {name}, 640×480"] = f"{ratio:.1f} ×"
    return Part("mirrors", "Mirrors, 640×480, one bounce", rows, summary, notes=notes)


def cold(bench: Bench) -> Part:
    """From the start of a process to its first picture, without and with shadows."""
    title = "First pictures of fresh processes, 640×480, no shader compiled before"
    if INT64 not in bench.adapter.handle.features:
        return Part("cold", title, [], notes=[f"Left out: shadows need {_LACKING}"])
    times = medians(_SHADOWED, bench.adapter.summary.index, bench.rounds, bench.progress)
    rows: list[dict[str, Value]] = [
        {
            "scene": name,
            "shadows": "with" if shadows else "without",
            "processor s": each.processor or None,
            "wall s": each.wall,
        }
        for (name, shadows), each in times.items()
    ]
    summary = {
        f"first picture of {name} with shadows, against one without": (
            f"{times[name, True].wall:.1f} s, "
            f"{times[name, True].wall / times[name, False].wall:.2f} ×"
        )
        for name in _SHADOWED
    }
    notes = ["Each process gets an empty cache for Mesa; other drivers may keep shaders elsewhere."]
    return Part("cold", title, rows, summary, notes=notes)


def threads(bench: Bench) -> Part:
    """Frame time against the threads of a software driver."""
    title = "A frame against threads"
    if not bench.on_processor:
        return Part("threads", title, [], notes=["Left out: the device is not the processor."])
    counts = sorted({1, *(2**k for k in range(8) if 2**k < machine.cores()), machine.cores()})
    found = {count: _own_process(bench, count) for count in counts}
    rows: list[dict[str, Value]] = [
        {"threads": count, "device ms": found[count], "speed-up": found[1] / found[count]}
        for count in counts
    ]
    last = counts[-1]
    summary = {f"{last} threads against one": f"{found[1] / found[last]:.2f} ×"} if last > 1 else {}
    fits = {}
    # Any line goes through two points.
    if len(counts) > 2:
        speed_ups = [found[1] / found[count] for count in counts]
        fits["speed-up against threads"] = line(counts, speed_ups)
    return Part("threads", title, rows, summary, fits)


def _own_process(bench: Bench, count: int) -> float:
    """Device time in ms of the largest picture of ``pixels`` with ``count`` threads.

    Another process measures it, because Mesa reads the number of threads only when it is loaded.
    """
    command = [sys.executable, "-m", "halfstep", "bench", "--only", "pixels", "--json"]
    command += ["--rounds", str(bench.rounds), "--adapter", str(bench.adapter.summary.index)]
    done = subprocess.run(
        command,
        env={**os.environ, "LP_NUM_THREADS": str(count)},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise HalfstepError(f"with LP_NUM_THREADS={count}: {done.stderr.strip()}")
    row = json.loads(done.stdout)["parts"]["pixels"]["rows"][-1]
    return float(row["device ms"] or row["wall ms"])


def _has_povray(notes: list[str]) -> bool:
    """Whether POV-Ray is installed; if not, a note says so."""
    try:
        povray.version()
    except povray.NoPovrayError as error:
        notes.append(f"POV-Ray is left out: {error}.")
        return False
    return True


def _scene_and_size(scene: Scene) -> str:
    return f"{len(scene.solids)} solids, {_named((scene.image.width, scene.image.height))}"


def _named(size: tuple[int, int]) -> str:
    return f"{size[0]}×{size[1]}"


# The parts by the name of the option `--only`, in the order of the report.
PARTS: dict[str, Callable[[Bench], Part]] = {
    "halving": halving,
    "steps": steps,
    "closed": closed,
    "povray": pov,
    "formulas": formulas,
    "twin": twin,
    "frames": frames,
    "regions": regions,
    "shadows": shadows,
    "mirrors": mirrors,
    "cold": cold,
    "solids": solids,
    "setup": setup,
    "pixels": pixels,
    "threads": threads,
}
