"""Tint, the compiler of Dawn and of Chrome, takes our shaders: those without 64-bit integers."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.resources import files
from importlib.util import find_spec

import pytest

from halfstep.contract.planes import DEVICE_OUTPUTS, OUTPUT_BYTES
from halfstep.frames.outputs import device_outputs
from halfstep.host.prepare import prepare
from halfstep.run.needs import needs_of_frame
from halfstep.scene import bundled_scenes, load, with_overrides
from halfstep.shader.source import compose
from tests.bundled import drawn_by_all
from tests.test_pack import SIZE

# On Dawn's backend without a device, so that no driver matters.
VALIDATOR = """
import json, os, sys
os.environ["WGPU_BACKEND_TYPE"] = "Null"
import wgpudawn
device = wgpudawn.gpu.request_adapter_sync().request_device_sync()
for text in json.load(sys.stdin):
    try:
        device.create_shader_module(code=text)
        print(json.dumps(None))
    except wgpudawn.GPUValidationError as error:
        print(json.dumps(str(error)))
"""
WIDE = re.compile(r"\b[iu]64\b|\d(li|lu)\b|subgroup")


def composed() -> Iterator[str]:
    """The shaders of all bundled scenes, with both methods and different outputs."""
    everything = frozenset(DEVICE_OUTPUTS.keys() | OUTPUT_BYTES)
    for name in bundled_scenes():
        for method in ("visible", "article") if name in drawn_by_all() else ("visible",):
            scene = with_overrides(load(name), size=SIZE, steps=12, method=method)
            prepared = prepare(scene)
            for outputs in (everything, device_outputs({"image"})):
                yield compose(needs_of_frame(prepared, method, outputs))


def faults(texts: list[str]) -> list[str | None]:
    """What Tint says of each text; None if it takes it."""
    result = subprocess.run(
        [sys.executable, "-c", VALIDATOR],
        input=json.dumps(texts), capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [json.loads(line) for line in result.stdout.splitlines()]


@pytest.fixture(autouse=True, scope="module")
def _tint() -> None:
    if find_spec("wgpudawn") is None:
        pytest.skip("wgpudawn is not installed")


@pytest.mark.slow
def test_tint_takes_the_shaders_of_all_scenes() -> None:
    texts = sorted({text for text in composed() if not WIDE.search(text)})
    assert len(texts) > 40
    assert {fault for fault in faults(texts) if fault is not None} == set()


def test_tint_takes_the_shaders_that_ask_a_device() -> None:
    folder = files("halfstep.wgsl")
    names = ("canary.wgsl", "probe_rounds.wgsl")
    assert faults([folder.joinpath(name).read_text() for name in names]) == [None, None]


def test_a_fault_that_naga_takes_is_found() -> None:
    # naga knows 64-bit integers, Tint does not.
    [fault, none] = faults(["const a = 1li;", "const a = 1i;"])
    assert fault is not None
    assert "error" in fault
    assert none is None
