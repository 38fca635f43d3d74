import numpy as np

from halfstep.testing import Sampler, unwritten

FILM = ["hash.wgsl", "film.wgsl"]
PICTURE = np.random.default_rng(8).integers(0, 256, (12, 16, 4), np.uint8)
LIGHT = PICTURE / np.float32(255)


def defined(*names):
    """A preprocessor that knows #ifdef, #else and #endif."""

    def preprocess(text):
        lines, keeps = [], True
        for line in text.split("\n"):
            if line.startswith("#ifdef"):
                keeps = line.split()[1] in names
            elif line == "#else":
                keeps = not keeps
            elif line == "#endif":
                keeps = True
            elif keeps:
                lines.append(line)
        return "\n".join(lines)

    return preprocess


def hashed(x):
    x = np.asarray(x, np.uint64)
    x ^= x >> np.uint64(16)
    x = x * np.uint64(0x7FEB352D) & np.uint64(0xFFFFFFFF)
    x ^= x >> np.uint64(15)
    x = x * np.uint64(0x846CA68B) & np.uint64(0xFFFFFFFF)
    return (x ^ x >> np.uint64(16)).astype(np.uint32)


def speck(seed):
    return {"result": (hashed(seed) >> 8) / 2**24, "seed": hashed(seed)}


def test_speck(wgsl):
    seed = np.random.default_rng(9).integers(0, 2**32, 1000, np.uint32)
    wgsl.check(
        FILM, "speck", speck, {"seed": seed}, returns=("result", "seed"), preprocess=defined()
    )


def test_grained_in_a_picture(wgsl):
    seed = np.arange(12 * 16, dtype=np.uint32).reshape(12, 16)
    wgsl.check(
        FILM,
        "grained",
        lambda light, seed: light + 0.25 * (speck(seed)["result"] - 0.5),
        {"light": LIGHT[..., 0], "seed": seed},
        constants={"GRAIN": 0.25},
        preprocess=defined(),
        float64=True,
        ulp=2,
        atol=1e-7,
    )


def test_vignette(wgsl):
    bound = {"picture": PICTURE, "between": Sampler("linear")}
    flat = wgsl.image(FILM, "vignette", (16, 12), bound, preprocess=defined())
    wgsl.compare_image(flat[..., :3], LIGHT[..., :3], atol=1 / 256)
    x, y = np.meshgrid((np.arange(16) + 0.5) / 16 - 0.5, (np.arange(12) + 0.5) / 12 - 0.5)
    dim = 1 - x**2 - y**2
    found = wgsl.image(FILM, "vignette", (16, 12), bound, preprocess=defined("ROUND"))
    wgsl.compare_image(found[..., :3], LIGHT[..., :3] * dim[..., None], atol=1 / 256)


def test_developing_and_measuring(wgsl):
    program = wgsl.program(
        FILM,
        {
            "picture": PICTURE,
            "between": Sampler(),
            "developed": unwritten((12, 16, 4), np.float32),
            "sums": np.zeros(12, np.float32),
        },
        preprocess=defined(),
    )
    program.dispatch("develop", (2, 2))
    wgsl.compare_image(program.read("developed"), 2 * LIGHT, ulp=1)
    program.dispatch("measure", 12)
    program.dispatch("total")
    np.testing.assert_allclose(program.read("sums")[0], LIGHT[..., 1].sum(), rtol=1e-5)
