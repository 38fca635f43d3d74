"""fixed32: the same bits on every device and with any number of threads, and nothing overflows."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.cli import main
from halfstep.contract.formats import FIXED32
from halfstep.contract.layout import TILE
from halfstep.device.adapters import Adapter
from halfstep.errors import AdapterError
from halfstep.frames.frame import Frame
from halfstep.host.prepare import prepare
from halfstep.run import gpu as run_gpu
from halfstep.run.gpu import Device
from halfstep.scene import Scene, load, with_overrides
from halfstep.twin import arithmetic_fixed, forms_fixed, halve_fixed, polynomial_exact
from halfstep.twin.lanes import Form
from halfstep.twin.piece import Line
from halfstep.twin.root import Root, end_value, has_root
from tests.scenes_random import KINDS, PLACES, random_scene
from tests.soundness import Shot, Way

OUTPUTS = ("solid", "surface", "t")
GOLDEN = Path(__file__).with_name("fixed32.json")
# Scene -> (steps, method) of the golden frames.
FRAMES = {
    "figure": (22, "visible"),
    "gallery": (12, "visible"),
    "one_cone": (30, "visible"),
    "edge_eye_inside_cylinder": (18, "visible"),
    "one_torus": (20, "visible"),
    "clebsch_cubic": (16, "visible"),
    "one_plane": (26, "article"),
    "one_box": (9, "article"),
    "one_hyperboloid_one_sheet": (14, "article"),
}
# Those of which shadows are golden, too.
SHADOWED = ("figure", "gallery")
SCENES = 66

Integers = NDArray[np.int64]


@pytest.fixture(scope="module")
def device(adapter: Adapter) -> Iterator[Device]:
    device = Device(adapter)
    yield device
    device.close()


def test_device_and_numpy_give_the_same_bits(device: Device, rng: np.random.Generator) -> None:
    """Every kind, n = 4 … 30, distances of 2 … 1e6 sizes, and cameras inside and on solids."""
    hits, steps = 0, set()
    for number in range(SCENES):
        kind, n = KINDS[number % len(KINDS)], 4 + number % 27
        most = 1 if number % 3 else 4
        scene = random_scene(rng, PLACES[number % len(PLACES)], most=most, kinds=(kind,)).scene
        way = Way(n, ("visible", "article")[number % 4 == 3], "fixed32")
        shot = Shot(scene, (64, 48))
        ours, expected = (shot.render(way, d, OUTPUTS) for d in (device, None))
        for name, values in expected.items():
            assert ours[name].tobytes() == values.tobytes(), (number, kind, str(way), name)
        hits += int((expected["solid"] >= 0).sum())
        steps.add(n)
    assert hits > 0.15 * SCENES * 64 * 48
    assert steps == set(range(4, 31))


def hashes(backend: str) -> dict[str, dict[str, str]]:
    """The hash of every golden array."""
    found = {}
    for name, (steps, method) in FRAMES.items():
        frame = _frame(name, steps, method, backend)
        arrays = {output: getattr(frame, output) for output in frame.outputs}
        found[name] = {
            output: hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
            for output, array in arrays.items()
        }
    return found


def _frame(name: str, steps: int, method: str, backend: str) -> Frame:
    return halfstep.render(
        load(name),
        size=(160, 120),
        steps=steps,
        method=method,
        number_format="fixed32",
        shadows=name in SHADOWED,
        outputs=(*OUTPUTS, "shadow") if name in SHADOWED else OUTPUTS,
        backend=backend,
    )


def test_any_machine_reproduces_the_golden_hashes(backend: str) -> None:
    assert hashes(backend) == json.loads(GOLDEN.read_text())


def _hashes_elsewhere(backend: str, **environment: str) -> dict[str, dict[str, str]]:
    """The hashes of another process."""
    program = f"import json, tests.test_fixed as t; print(json.dumps(t.hashes({backend!r})))"
    result = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | environment,
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, dict[str, str]] = json.loads(result.stdout)
    return found


@pytest.mark.parametrize("threads", [1, 2, 8])
@pytest.mark.usefixtures("adapter")
def test_any_number_of_threads_gives_the_same_bits(threads: int) -> None:
    found = _hashes_elsewhere("gpu", LP_NUM_THREADS=str(threads))
    assert found == json.loads(GOLDEN.read_text())


def test_what_the_processor_can_do_does_not_matter() -> None:
    """The host's constants too are the same without its vector units and with a plain BLAS."""
    umath = np._core._multiarray_umath  # type: ignore[attr-defined]
    there = [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__.get(name)]
    environment = {"NPY_DISABLE_CPU_FEATURES": " ".join(there), "OPENBLAS_CORETYPE": "Prescott"}
    assert _hashes_elsewhere("numpy", **environment) == json.loads(GOLDEN.read_text())


def test_the_image_has_the_same_bits(backend: str) -> None:
    """On lavapipe shading too; the picture hardly differs from that of float32."""
    options: dict[str, Any] = {"size": (160, 120), "outputs": ("image",)}
    scene = load("gallery")
    fixed = halfstep.render(scene, number_format="fixed32", backend=backend, **options).image
    twin = halfstep.render(scene, number_format="fixed32", backend="numpy", **options).image
    np.testing.assert_array_equal(fixed, twin)
    floating = halfstep.render(scene, backend="numpy", **options).image
    assert np.mean((fixed != floating).any(axis=-1)) < 0.01


@pytest.mark.usefixtures("adapter")
def test_without_64_bit_integers_it_is_numpy_or_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run_gpu, "INT64", "no such feature")
    # Whoever asks for a certain driver gets that one or none.
    monkeypatch.delenv("HALFSTEP_EXPECT_LAVAPIPE", raising=False)
    options: dict[str, Any] = {"size": (32, 24), "outputs": ("solid",)}
    scene = load("one_sphere")
    reason = "has no 64-bit integers in shaders, which fixed32 needs; use float32"
    with pytest.raises(AdapterError, match=reason):
        halfstep.render(scene, number_format="fixed32", backend="gpu", **options)
    with pytest.warns(UserWarning, match="rendering with NumPy, slowly: adapter .*" + reason):
        frame = halfstep.render(scene, number_format="fixed32", **options)
    assert frame.info["adapter"] == "numpy"
    with pytest.warns(UserWarning, match="which more than 16 steps need; use fewer"):
        frame = halfstep.render(scene, steps=17, **options)
    assert frame.info["adapter"] == "numpy"
    file = tmp_path / "out.png"
    arguments = ["one_sphere", "-o", str(file), "--format", "fixed32", "--backend", "gpu"]
    assert main(["render", *arguments]) == 3
    assert reason in capsys.readouterr().err
    assert not file.exists()


# ------------------------------------------------------------------------------ the bit budget


def _large_scene(kind: dict[str, Any]) -> Scene:
    """A solid that fills the largest picture, seen askew."""
    camera = {
        "center": [0.3, -1.7, 0.4],
        "look_at": [0.1, 0.2, -0.1],
        "up": [0.3, 0.1, 1.0],
        "fov_degrees": 70,
    }
    volume = {"min": [-1.5, -1.2, -1.5], "max": [1.5, 1.5, 1.5]}
    solid = {"color": [1, 1, 1], **kind}
    return Scene.from_dict({"format": 1, "camera": camera, "solid": [solid], "volume": volume})


LARGE: dict[str, dict[str, Any]] = {
    "ellipsoid": {"kind": "ellipsoid", "semi_axes": [1.0, 1.2, 1.4]},
    "hyperboloid": {
        "kind": "hyperboloid_one_sheet",
        "waist": 0.3,
        "c": 0.4,
        "z_min": -1.0,
        "z_max": 1.0,
        "cut": [[1.0, 2.0, 3.0, 0.7]],
    },
    "box": {"kind": "box", "size": [2.0, 2.5, 1e-4], "rotation_degrees": [20, 30, 40]},
}


def _exact(k: NDArray[np.int64], x: int, y: int) -> int:
    """A polynomial in unbounded integers."""
    monomials = [1, x, y, x * x, x * y, y * y]
    return sum(int(c) * m for c, m in zip(k, monomials, strict=False))


def _rounded(number: int, excess: int) -> int:
    return (number + ((1 << excess) >> 1)) >> excess


@pytest.mark.parametrize("name", LARGE)
def test_the_largest_picture_overflows_nothing(name: str, rng: np.random.Generator) -> None:
    """16384 x 16384 pixels of 8 x 8 samples: in unbounded integers the same values come out."""
    scene = with_overrides(
        _large_scene(LARGE[name]), number_format="fixed32", steps=30, size=(16384, 16384)
    )
    packed = prepare(scene, samples=8)
    solid = packed.solids[0]
    assert np.ptp(packed.setup.rectangle[0, :2]) > 100_000
    reach = 1 << 16
    corner = reach + TILE - 1
    places = [(i, j) for i in (-corner, 0, corner) for j in (-corner, 0, corner)]
    places += rng.integers(-reach, reach, (200, 2)).tolist()
    for x, y in places:
        at = polynomial_exact.Offset(np.array([x], np.int64), np.array([y], np.int64))
        for row in packed.half_spaces:
            line = forms_fixed.line_at(row["c"], row["b"], at)
            c, b = _exact(row["c"], x, y), _exact(row["b"], x, y)
            excess = max(max(abs(c), abs(b)).bit_length() - 29, 0)
            assert [v.item() for v in line] == [_rounded(c, excess), _rounded(b, excess)]
        if name == "box":
            continue
        form = forms_fixed.form_at(solid["a"], solid["g"], solid["c"], at)
        a, g, c = (_exact(solid[letter], x, y) for letter in "agc")
        size = max(abs(c), abs(g) + 3 * abs(a))
        assert size < 2**62
        excess = max(size.bit_length() - 29, 0)
        assert [v.item() for v in form] == [_rounded(k, excess) for k in (a, g, c)]


def _largest(rng: np.random.Generator, count: int) -> Form:
    """Forms at the limits: |C| or |G| + 3 |A| is 2^29, or nearly."""
    a = np.rint(2.0**29 / 3 * rng.choice([0.0, 1e-6, 0.3, 0.99], count) * rng.random(count))
    g = 2.0**29 - 3 * a - rng.choice([0, 1, 12345], count)
    c = 2.0**29 * rng.choice([1.0, 0.999, 0.5, 1e-3, 0.0], count)
    signs = rng.choice([-1.0, 1.0], (3, count))
    return Form(
        *(np.rint(s * np.abs(k)).astype(np.int32) for s, k in zip(signs, (a, g, c), strict=True))
    )


def test_products_at_the_limits_overflow_nothing(rng: np.random.Generator) -> None:
    form = _largest(rng, 2000)
    c, b = (np.rint(2.0**30 * rng.uniform(-1, 1, 2000)).astype(np.int32) for _ in range(2))
    b[:1000] = np.copysign(2.0**30, b[:1000]).astype(np.int32)
    c[:500] = b[:500]
    values, roots = end_value(form, c, b), has_root(form)
    for k in range(2000):
        fa, fg, fc, lc, lb = (int(v[k]) for v in (*form, c, b))
        sloped = -(-(fa * lc - fg * lb) >> 30)
        expected = sloped * lc + -(-(fc * lb) >> 30) * lb
        assert int(values[k]) == expected
        assert abs(expected) < 2**62
        assert roots[k] == (fg * fg >= 4 * fa * fc)


def _halved(a: int, g: int, c: int, steps: int) -> tuple[int, int]:
    """The digit recurrence in unbounded integers without a limit; the position and the largest."""
    position, value, slope, most = 0, c, g, 0
    for k in range(1, steps + 1):
        bend = (a + (1 << (k - 1))) >> k
        sign = 1 if value > 0 and slope < 0 else -1
        value, slope = 2 * value + sign * slope + bend, slope + 2 * sign * bend
        most = max(most, abs(slope))
        position = 2 * position + sign
    return position, most


@pytest.mark.parametrize("steps", [1, 13, 30])
def test_halvings_at_the_limits_overflow_nothing(steps: int, rng: np.random.Generator) -> None:
    """Stopping 2^k F at 2^29 changes no sign, so no position: of hits and misses alike."""
    form = _largest(rng, 2000)
    never = np.zeros(2000, bool)
    root = Root(~never, np.zeros(2000, np.int32), np.abs(form.a), form.g, form.c, never)
    search = halve_fixed.begun(root)
    for k in range(steps):
        search = halve_fixed.halved(search, k)
    positions = halve_fixed.reached(search, root, steps)
    for k in range(2000):
        expected, most = _halved(int(root.a[k]), int(root.g[k]), int(root.c[k]), steps)
        assert int(positions[k]) == expected
        assert most <= 2**29 + 60


def test_what_is_positive_stays_positive_when_reduced(rng: np.random.Generator) -> None:
    wide = np.append(rng.integers(-(2**61), 2**61, 1000), [-1, 0, 1, 2**30, -(2**30)])
    reduced = arithmetic_fixed.reduced(wide)
    for number, value in zip(wide.tolist(), reduced.tolist(), strict=True):
        assert value == -(-number >> 30)
        assert (value > 0) == (number > 0)


def test_forms_keep_29_bits_on_every_ray(rng: np.random.Generator) -> None:
    packed = prepare(
        with_overrides(load("gallery"), size=(160, 120), number_format="fixed32", steps=20)
    )
    assert packed.format is FIXED32
    x = np.arange(-40, 40, dtype=np.int64)[None]
    y = rng.integers(-40, 40, (50, 1))
    for solid in packed.solids[packed.classes <= 2]:
        form = forms_fixed.form_at(
            solid["a"], solid["g"], solid["c"], polynomial_exact.Offset(x, y)
        )
        size = np.maximum(np.abs(form.c), np.abs(form.g) + 3 * np.abs(form.a))
        assert 2**28 - 4 <= size.min() <= size.max() <= 2**29 + 4
    for row in packed.half_spaces:
        line: Line = forms_fixed.line_at(row["c"], row["b"], polynomial_exact.Offset(x, y))
        size = np.maximum(np.abs(line.c), np.abs(line.b))
        assert 2**28 <= size.min() <= size.max() <= 2**29


if __name__ == "__main__":
    GOLDEN.write_text(json.dumps(hashes("numpy"), indent=2) + "\n")
