"""What threads, forks, interrupts and copies do to a Renderer: a right frame or a clear refusal."""

from __future__ import annotations

import copy
import json
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.errors import DeviceError, HalfstepError, UsageError
from halfstep.frames.frame import Frame
from halfstep.frames.renderer import Renderer
from halfstep.host.prepare import prepare
from halfstep.run import gpu as run_gpu
from halfstep.scene import Scene
from tests.interleavings import SCENES

# A second at most, but that other processes may have the machine; a wait for ever ends then.
SECONDS = 120
CLOSED = "the renderer is closed"
FORKED = (
    "this process was forked from one that uses a graphics driver, which does not survive it; "
    'start processes with multiprocessing.get_context("spawn")'
)
BEGIN = """
import gc, os, sys, threading, time, warnings
warnings.simplefilter("ignore", DeprecationWarning)  # of forks with threads, which are meant
import halfstep
from tests.interleavings import SCENES
"""

# For the process ``child``, which is not to outlive a test that fails.
WAIT = """
end = time.monotonic() + 30
while (ended := os.waitpid(child, os.WNOHANG)) == (0, 0):
    if time.monotonic() > end:
        os.kill(child, 9)
        sys.exit("the child waits for ever")
    time.sleep(0.01)
"""


def run(script: str, **environ: str | None) -> str:
    """What ``script`` prints, in a process of its own, which an abort would end and not the tests.

    Args:
        script: after `BEGIN`.
        environ: variables that differ; None for one that is not set.
    """
    changed = {name: value for name, value in (os.environ | environ).items() if value is not None}
    done = subprocess.run(
        [sys.executable, "-c", BEGIN + script],
        env=changed,
        capture_output=True,
        text=True,
        timeout=SECONDS,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout


def assert_equal(frame: Frame, scene: Scene) -> None:
    """``frame`` has the bits of one rendered alone, on the same back end."""
    backend = "numpy" if frame.info["adapter"] == "numpy" else "gpu"
    alone = halfstep.render(scene, outputs=frame.outputs, backend=backend)
    for name in alone.outputs:
        assert getattr(frame, name).tobytes() == getattr(alone, name).tobytes(), name
    assert frame.info["scene_sha256"] == scene.sha256


@pytest.fixture
def renderer(backend: str) -> Iterator[Renderer]:
    with Renderer(SCENES[0], outputs=("image", "depth"), backend=backend) as renderer:
        yield renderer


@pytest.fixture
def gpu_renderer(adapter: Adapter) -> Iterator[Renderer]:
    del adapter
    with Renderer(SCENES[0], outputs=("image", "depth"), backend="gpu") as renderer:
        yield renderer


@pytest.fixture
def in_a_band(monkeypatch: pytest.MonkeyPatch) -> list[Callable[[], None]]:
    """What is called, once each, from within the next bands that a device renders."""
    pending: list[Callable[[], None]] = []
    render_band = run_gpu.Device.render_band

    def rendered(self: run_gpu.Device, *job: Any) -> Any:
        if pending:
            pending.pop(0)()
        return render_band(self, *job)

    monkeypatch.setattr(run_gpu.Device, "render_band", rendered)
    return pending


# ------------------------------------------------------------------------------------- threads


@pytest.mark.slow
def test_interleavings_give_right_frames(backend: str, seed: int) -> None:
    done = subprocess.run(
        [
            *(sys.executable, "-m", "tests.interleavings"),
            *("--rounds", "4", "--seed", str(seed), "--backend", backend),
        ],
        capture_output=True,
        text=True,
        timeout=SECONDS,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(done.stdout)
    assert found["wrong"] == 0
    counts = found["counts"]
    assert counts["rounds"] == 4
    assert counts["threads"] > counts["rounds"]
    assert counts["frames"] >= 20


def test_threads_may_be_the_first_to_use_a_driver_without_a_runtime_directory(
    adapter: Adapter,
) -> None:
    del adapter
    script = """
from concurrent.futures import ThreadPoolExecutor
start = threading.Barrier(4)
def first(_):
    start.wait()
    return halfstep.render(SCENES[0], outputs=("image",), backend="gpu").image.shape
with ThreadPoolExecutor(4) as pool:
    print(*pool.map(first, range(4)), os.environ.get("XDG_RUNTIME_DIR"))
"""
    assert run(script, XDG_RUNTIME_DIR=None) == "(30, 40, 3) " * 4 + "None\n"


def test_preparing_overlaps_rendering(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first frame is rendered only after the second was prepared."""
    prepared, both = Renderer.prepare, threading.Event()
    render_prepared = Renderer.render_prepared
    seen: list[Any] = []

    def noted(self: Renderer, scene: Any = None, **options: Any) -> Any:
        frame = prepared(self, scene, **options)
        seen.append(scene)
        if len(seen) == 2:
            both.set()
        return frame

    def waited(self: Renderer, *job: Any) -> Any:
        assert both.wait(SECONDS)
        return render_prepared(self, *job)

    monkeypatch.setattr(Renderer, "prepare", noted)
    monkeypatch.setattr(Renderer, "render_prepared", waited)
    for scene, frame in zip(SCENES, renderer.render_all(SCENES), strict=True):
        assert_equal(frame, scene)


def test_the_frames_of_two_threads_say_what_they_show(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another frame between all that a frame looks up and what it makes of that."""
    other: list[Frame] = []
    entered: list[None] = []

    def interrupted(*job: Any, **facts: Any) -> Any:
        if not entered:
            entered.append(None)
            with ThreadPoolExecutor(1) as thread:
                other.append(thread.submit(renderer.render, SCENES[1]).result())
        return prepare(*job, **facts)

    monkeypatch.setattr("halfstep.frames.renderer.prepare", interrupted)
    assert_equal(renderer.render(SCENES[2]), SCENES[2])
    assert_equal(other[0], SCENES[1])


# --------------------------------------------------------------------------------------- close


def test_close_waits_for_the_frame_that_is_rendered(
    gpu_renderer: Renderer, in_a_band: list[Callable[[], None]]
) -> None:
    begun, closing = threading.Event(), threading.Event()

    def wait() -> None:
        begun.set()
        assert closing.wait(SECONDS)

    in_a_band.append(wait)
    with ThreadPoolExecutor(2) as pool:
        frame = pool.submit(gpu_renderer.render)
        assert begun.wait(SECONDS)
        closed = pool.submit(gpu_renderer.close)
        with pytest.raises(TimeoutError):
            closed.result(0.2)
        # Others are refused at once.
        with pytest.raises(UsageError, match=CLOSED):
            gpu_renderer.render()
        closing.set()
        closed.result(SECONDS)
        assert_equal(frame.result(SECONDS), SCENES[0])


def test_after_close_render_all_has_no_frames(renderer: Renderer) -> None:
    for count in (1, 2, 5):
        frames = renderer.render_all(SCENES[:1] * 5)
        for _ in range(count if count < 5 else 4):
            next(frames)
        if count == 5:
            renderer.close()
            with pytest.raises(UsageError, match=CLOSED):
                next(frames)
            assert list(frames) == []


def test_closed_renderers_give_memory_and_threads_back(adapter: Adapter) -> None:
    del adapter
    script = """
gc.disable()
kept, used = [], []
def usage():
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    return int(status["VmRSS"].split()[0]) >> 10, int(status["Threads"])
for count in range(30):
    with halfstep.Renderer(SCENES[0], backend="gpu") as renderer:
        renderer.render()
        list(renderer.render_all(SCENES))
        left = renderer.render_all(SCENES)
        next(left)
    left.close()
    kept.append(renderer)
    used.append(usage())
memory, threads = zip(*used)
# The least of some rounds: allocators take more for a while.
more = min(memory[20:]) - min(memory[10:20])
threads = threads[9]
end = time.monotonic() + 20
while usage()[1] > threads and time.monotonic() < end:
    time.sleep(0.1)
print(more, usage()[1] - threads)
"""
    # Else malloc gives threads that wait for each other arenas of their own, which it keeps: 20 to
    # 50 MiB, taken in steps at any round, and no more of it after 200 Renderers than after 70.
    megabytes, threads = map(int, run(script, MALLOC_ARENA_MAX="1").split())
    assert megabytes <= 4
    assert threads <= 0


# ---------------------------------------------------------------------- in the middle of a frame


def test_a_frame_in_the_middle_of_another_is_refused(
    gpu_renderer: Renderer, in_a_band: list[Callable[[], None]]
) -> None:
    """As a signal handler, which finds its own thread anywhere, may ask for it."""
    refused: list[str] = []

    def ask() -> None:
        try:
            gpu_renderer.render()
        except UsageError as error:
            refused.append(str(error))

    in_a_band.append(ask)
    assert_equal(gpu_renderer.render(), SCENES[0])
    assert refused == [
        "the renderer is in the middle of another frame of this thread; a signal handler or a "
        "finalizer cannot have one of it"
    ]
    assert_equal(gpu_renderer.render(), SCENES[0])


def test_close_in_the_middle_of_a_frame_comes_after_it(
    gpu_renderer: Renderer, in_a_band: list[Callable[[], None]]
) -> None:
    in_a_band.append(gpu_renderer.close)
    assert_equal(gpu_renderer.render(), SCENES[0])
    with pytest.raises(UsageError, match=CLOSED):
        gpu_renderer.render()
    assert isinstance(gpu_renderer._backend, run_gpu.Device)
    assert gpu_renderer._backend._open is None


def test_a_render_all_that_is_collected_in_the_middle_of_a_frame_waits_for_nothing(
    adapter: Adapter,
) -> None:
    del adapter
    script = """
from halfstep.run import gpu as run_gpu
main, inside = threading.current_thread(), threading.Event()
finished, render_band = halfstep.Renderer.render_prepared, run_gpu.Device.render_band
rendered = []
def waiting(self, frame):
    # The second frame of render_all asks for its turn when main has it.
    if threading.current_thread() is not main:
        rendered.append(frame)
        if len(rendered) == 2:
            inside.wait()
    return finished(self, frame)
def collecting(self, *job):
    if threading.current_thread() is main:
        inside.set()
        time.sleep(0.1)
        gc.collect()
        print("collected")
    return render_band(self, *job)
halfstep.Renderer.render_prepared, run_gpu.Device.render_band = waiting, collecting
gc.disable()
with halfstep.Renderer(SCENES[0], backend="gpu") as renderer:
    cycle = [renderer.render_all(SCENES)]
    cycle.append(cycle)
    next(cycle[0])
    del cycle
    print(renderer.render().image.shape)
"""
    assert run(script) == "collected\n(30, 40, 3)\n"


@pytest.mark.parametrize("name", ["MapAsync", "GetMappedRange", "Unmap"])
def test_after_an_interrupt_frames_are_right(adapter: Adapter, name: str) -> None:
    """Ctrl-C while a frame is waited for, or is read."""
    del adapter
    script = f"""
from halfstep.device import reading
alone = [halfstep.render(scene, backend="gpu").depth.tobytes() for scene in SCENES]
calls, name = reading._native().calls, "wgpuBuffer{name}"
call = getattr(calls, name)
def interrupted(*args):
    if name.endswith("MapAsync"):
        call(*args)
    raise KeyboardInterrupt
with halfstep.Renderer(SCENES[0], outputs=("depth",), backend="gpu") as renderer:
    renderer.render()
    setattr(calls, name, interrupted)
    try:
        renderer.render(SCENES[1])
    except KeyboardInterrupt:
        print("interrupted")
    setattr(calls, name, call)
    for number in (0, 1, 2, 0):
        print(renderer.render(SCENES[number]).depth.tobytes() == alone[number])
"""
    assert run(script) == "interrupted\n" + 4 * "True\n"


def test_a_signal_while_the_device_works_interrupts_the_frame(adapter: Adapter) -> None:
    del adapter
    script = """
import signal
from halfstep.device import reading
calls = reading._native().calls
poll = calls.wgpuDevicePoll
def signalled(*args):
    os.kill(os.getpid(), signal.SIGINT)
    return poll(*args)
with halfstep.Renderer(SCENES[0], outputs=("depth",), backend="gpu") as renderer:
    before = renderer.render().depth.tobytes()
    calls.wgpuDevicePoll = signalled
    try:
        renderer.render()
    except KeyboardInterrupt:
        print("interrupted")
    calls.wgpuDevicePoll = poll
    print(renderer.render().depth.tobytes() == before)
"""
    assert run(script) == "interrupted\nTrue\n"


def test_an_error_in_a_thread_leaves_the_renderer_usable(renderer: Renderer) -> None:
    def one(number: int) -> str | None:
        try:
            camera = {"up": (0, -6, 2)} if number % 2 else None
            assert_equal(renderer.render(SCENES[0], camera=camera), SCENES[0])
        except HalfstepError as error:
            return type(error).__name__
        return None

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(one, range(8))) == [None, "SceneError"] * 4


# ----------------------------------------------------------------------------- forks and copies


@pytest.mark.parametrize(
    ("backend", "child", "said"),
    [
        ("gpu", "renderer.render()", f"DeviceError: {FORKED}"),
        ("gpu", "next(frames)", f"DeviceError: {FORKED}"),
        ("gpu", "list(renderer.render_all(SCENES))", f"DeviceError: {FORKED}"),
        ("gpu", "halfstep.Renderer(SCENES[0], backend='gpu')", f"DeviceError: {FORKED}"),
        ("gpu", "renderer.close()", ""),
        ("gpu", "halfstep.render(SCENES[0], backend='numpy')", ""),
        ("numpy", "renderer.render(); renderer.close()", ""),
        (
            "numpy",
            "next(frames)",
            "UsageError: this process was forked in the middle of render_all; call it again",
        ),
    ],
)
@pytest.mark.slow
def test_a_forked_child_is_refused_what_needs_the_driver(
    request: pytest.FixtureRequest, backend: str, child: str, said: str
) -> None:
    if backend == "gpu":
        request.getfixturevalue("adapter")
    script = f"""
renderer = halfstep.Renderer(SCENES[0], backend="{backend}")
frames = renderer.render_all(SCENES)
next(frames)
# Another thread is in the middle of a frame.
loop = threading.Thread(target=lambda: [renderer.render() for _ in range(20)])
loop.start()
time.sleep(0.05)
child = os.fork()
if child == 0:
    try:
        {child}
    except halfstep.HalfstepError as error:
        print(f"{{type(error).__name__}}: {{error}}", flush=True)
    sys.exit(0)
{WAIT}
loop.join()
print(len(list(frames)), renderer.render().image.shape)
"""
    assert run(script) == (said + "\n" if said else "") + "2 (30, 40, 3)\n"


@pytest.mark.parametrize("child", ["", "del renderer; gc.collect()"])
def test_a_forked_child_leaves_the_device_to_its_parent(adapter: Adapter, child: str) -> None:
    """It ends, though what it has of the driver cannot be destroyed without its threads."""
    del adapter
    script = f"""
renderer = halfstep.Renderer(SCENES[0], backend="gpu")
renderer.render()
child = os.fork()
if child == 0:
    {child}
    sys.exit(0)
{WAIT}
print(renderer.render().image.shape)
"""
    assert run(script) == "(30, 40, 3)\n"


def test_a_forked_child_ends_though_the_driver_would_wait(adapter: Adapter) -> None:
    del adapter
    script = f"""
import ctypes
renderer = halfstep.Renderer(SCENES[0], backend="gpu")
libc = ctypes.CDLL(None)
# As that of a driver that waits for its threads when the process exits.
libc.on_exit(libc.pause, None)
child = os.fork()
if child == 0:
    libc.printf(b"what C has in a buffer, ")
    sys.exit(7)
{WAIT}
print("and the exit code", os.waitstatus_to_exitcode(ended[1]), flush=True)
os._exit(0)
"""
    assert run(script) == "what C has in a buffer, and the exit code 7\n"


def test_a_worker_of_render_frames_can_be_forked_while_a_thread_renders() -> None:
    script = """
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from halfstep.frames import sequence
sequence._rendering.acquire()
with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as executor:
    [frame] = halfstep.render_frames(SCENES[0], [0], executor, backend="numpy")
print(frame.image.shape)
"""
    assert run(script) == "(30, 40, 3)\n"


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_renderer_is_not_copied(renderer: Renderer, copied: Callable[[Any], Any]) -> None:
    for it in (renderer, renderer.render):
        if copied is pickle.dumps or it is renderer:
            with pytest.raises(UsageError) as caught:
                copied(it)
            assert str(caught.value) == (
                "a Renderer cannot be copied or pickled, as its device belongs to this process; "
                "make another one, with the same scene and options"
            )


def test_a_device_is_told_from_one_of_a_parent(
    gpu_renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("halfstep.device.adapters._process", os.getpid() + 1)
    with pytest.raises(DeviceError) as caught:
        gpu_renderer.render()
    assert str(caught.value) == FORKED
