"""What threads, forks and closed renderers do to a device."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from halfstep.device.adapters import Adapter

# A second at most, but that other processes may have the machine; a wait for ever ends then.
SECONDS = 120
BEGIN = """
import gc, os, sys, threading, time, warnings
warnings.simplefilter("ignore", DeprecationWarning)  # of forks with threads, which are meant
import halfstep
"""

# For the process ``child``, which is not to outlive a test that fails.
WAIT = """
end = time.monotonic() + 30
while os.waitpid(child, os.WNOHANG) == (0, 0):
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


def test_threads_may_be_the_first_to_use_a_driver_without_a_runtime_directory(
    adapter: Adapter,
) -> None:
    del adapter
    script = """
from concurrent.futures import ThreadPoolExecutor
start = threading.Barrier(4)
def first(_):
    start.wait()
    scene = halfstep.load("one_sphere")
    return halfstep.render(scene, outputs=("image",), backend="gpu").image.shape
with ThreadPoolExecutor(4) as pool:
    print(*pool.map(first, range(4)), os.environ.get("XDG_RUNTIME_DIR"))
"""
    assert run(script, XDG_RUNTIME_DIR=None) == "(480, 640, 3) " * 4 + "None\n"


def test_closed_renderers_give_memory_and_threads_back(adapter: Adapter) -> None:
    del adapter
    script = """
gc.disable()
kept = []
def usage():
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    return int(status["VmRSS"].split()[0]) >> 10, int(status["Threads"])
for count in range(30):
    with halfstep.Renderer(halfstep.load("one_sphere"), backend="gpu") as renderer:
        renderer.render()
    kept.append(renderer)
    if count == 9:
        memory, threads = usage()
end = time.monotonic() + 20
while usage()[1] > threads and time.monotonic() < end:
    time.sleep(0.1)
print(usage()[0] - memory, usage()[1] - threads)
"""
    megabytes, threads = map(int, run(script).split())
    assert megabytes <= 8
    assert threads <= 0


@pytest.mark.parametrize("child", ["", "del renderer; gc.collect()"])
def test_a_forked_child_leaves_the_device_to_its_parent(adapter: Adapter, child: str) -> None:
    """It ends, though what it has of the driver cannot be destroyed without its threads."""
    del adapter
    script = f"""
renderer = halfstep.Renderer(halfstep.load("one_sphere"), backend="gpu")
renderer.render()
child = os.fork()
if child == 0:
    {child}
    sys.exit(0)
{WAIT}
print(renderer.render().image.shape)
"""
    assert run(script) == "(480, 640, 3)\n"
