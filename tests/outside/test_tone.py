from pathlib import Path

import numpy as np

TONE = Path(__file__).parent / "tone.wgsl"


def encoded(light):
    """255 times sRGB in double precision."""
    light = light.astype(np.float64)
    high = 1.055 * light ** (1 / 2.4) - 0.055
    return 255 * np.clip(np.where(light <= 0.0031308, 12.92 * light, high), 0, 1)


def level(light):
    return np.floor(encoded(light) + 0.5).astype(np.uint32)


def from_a_step(light):
    """How far the value is from where the next level begins, in units of what it may be off."""
    return np.abs(encoded(light) % 1 - 0.5) / 0.001


def test_level(wgsl):
    light = np.random.default_rng(7).random(10_000, np.float32)
    census = wgsl.check(TONE, "level", level, {"light": light}, margin=from_a_step)
    assert census.ambiguous < 20


def test_histogram(wgsl):
    light = np.linspace(0, 1, 1000, dtype=np.float32) ** 2
    found = wgsl.kernel(
        TONE, "histogram", {"lights": light, "counts": np.zeros(256, np.uint32)}, workgroups=16
    )
    assert found["counts"].sum() == 1000
    wgsl.compare(found["counts"], np.bincount(level(light), minlength=256), atol=1)
