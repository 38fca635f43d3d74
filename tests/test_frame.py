"""What a Frame holds: shapes, types, values of a miss, and how its arrays agree, on both back ends.

The hits themselves are judged elsewhere; here each array is held against the others and against
the equations of the solids.
"""

from __future__ import annotations

import copy
import functools
import pickle
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import Array
from halfstep.errors import UsageError
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS, check_outputs, device_outputs
from halfstep.host.camera import view
from halfstep.scene import PlanePatch, QuadricSolid, Scene, Solid, bundled_scenes

WIDTH, HEIGHT, STEPS = 72, 54, 16
# Name -> trailing axes, dtype, value where nothing is hit (None: tested on its own).
CONTRACT: dict[str, tuple[tuple[int, ...], type, float | None]] = {
    "image": ((3,), np.uint8, None),
    "color": ((3,), np.float32, None),
    "solid": ((), np.int32, -1),
    "surface": ((), np.int32, -1),
    "t": ((), np.float64, np.nan),
    "depth": ((), np.float64, np.nan),
    "depth_exit": ((), np.float64, np.nan),
    "position": ((3,), np.float64, np.nan),
    "normal": ((3,), np.float32, 0),
    "error": ((), np.float64, None),
    "steps": ((), np.int32, 0),
    # Of cells, which the gallery has none of.
    "place": ((), np.int32, -1),
    "cell": ((), np.int32, -1),
    "material": ((), np.int32, -1),
    "shadow": ((), np.uint32, 0),
    "overlap": ((), np.float64, None),
    "gap": ((), np.float64, None),
}
# Twice what `STEPS` halvings of the deepest solid of the gallery leave, along the ray.
DISTANCE = 3e-4


@functools.cache
def gallery(backend: str) -> Frame:
    """All outputs of every kind of solid in one picture, with background around them."""
    return halfstep.render(
        halfstep.load("gallery"),
        size=(WIDTH, HEIGHT),
        steps=STEPS,
        backend=backend,
        camera={"fov_degrees": 60},
    )


def a_scene(center: tuple[float, ...], solid: dict[str, Any], **tables: Any) -> Scene:
    camera = {"center": center, "look_at": (0, 0, 0)}
    return Scene.from_dict(
        {"format": 1, "camera": camera, "solid": [{"color": (1, 0, 0), **solid}], **tables}
    )


def local(solid: Solid, points: Array) -> Array:
    return np.asarray((points - solid.origin) @ solid.world_from_local())


def test_every_output_has_its_shape_type_and_value_of_a_miss(backend: str) -> None:
    frame = gallery(backend)
    assert frame.outputs == tuple(CONTRACT)
    miss = frame.solid == -1
    assert 0 < miss.sum() < miss.size
    for name, (axes, dtype, value) in CONTRACT.items():
        array = getattr(frame, name)
        assert (array.shape, array.dtype) == ((HEIGHT, WIDTH, *axes), dtype), name
        if value is not None:
            np.testing.assert_array_equal(array[miss], value, err_msg=name)
            assert np.isfinite(array[~miss]).all(), name


def test_every_kind_of_solid_is_seen(backend: str) -> None:
    frame, scene = gallery(backend), halfstep.load("gallery")
    kinds = {scene.solids[ix].kind for ix in np.unique(frame.solid[frame.solid >= 0])}
    assert kinds == {solid.kind for solid in scene.solids}
    assert len(kinds) == 11


def test_a_miss_is_the_background(backend: str) -> None:
    frame, scene = gallery(backend), halfstep.load("gallery")
    miss = frame.solid == -1
    background = np.array(scene.image.background, np.float32)
    np.testing.assert_array_equal(frame.color[miss], np.broadcast_to(background, (miss.sum(), 3)))


def test_the_image_is_the_color_in_srgb(backend: str) -> None:
    frame = gallery(backend)
    linear = np.clip(frame.color.astype(np.float64), 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_array_equal(frame.image, np.floor(255 * srgb + 0.5))
    assert len(np.unique(frame.image)) > 50


def test_depth_is_t_times_the_far_base_plane(backend: str) -> None:
    frame = gallery(backend)
    hit = frame.solid >= 0
    t, depth = frame.t[hit], frame.depth[hit]
    assert ((t > 0) & (t < 1)).all()
    far = depth / t
    np.testing.assert_allclose(far, far[0], rtol=1e-15)
    assert (frame.depth_exit[hit] <= far[0] * (1 + 1e-15)).all()


def test_a_position_lies_on_its_ray(backend: str) -> None:
    frame = gallery(backend)
    camera = halfstep.load("gallery").camera.model_copy(update={"fov_degrees": 60.0})
    eye = view(camera, (WIDTH, HEIGHT))
    right, down, depth = np.moveaxis((frame.position - eye.eye) @ eye.camera_from_world.T, -1, 0)
    hit = frame.solid >= 0
    j, i = np.nonzero(hit)
    half = np.tan(np.radians(30))
    np.testing.assert_allclose(depth[hit], frame.depth[hit], rtol=1e-13)
    column = (right / depth / half / (WIDTH / HEIGHT) + 1) * WIDTH / 2 - 0.5
    row = (down / depth / half + 1) * HEIGHT / 2 - 0.5
    np.testing.assert_allclose(column[hit], i, atol=1e-9)
    np.testing.assert_allclose(row[hit], j, atol=1e-9)


def test_a_position_lies_on_its_surface_and_in_its_solid(backend: str) -> None:
    frame, scene = gallery(backend), halfstep.load("gallery")
    checked = set()
    for ix, solid in enumerate(scene.solids):
        here = frame.solid == ix
        at = local(solid, frame.position[here])
        surface = frame.surface[here]
        checked.add((solid.kind, *np.unique(surface)))
        if isinstance(solid, PlanePatch):
            world = frame.position[here]
            assert np.abs(at[:, 2]).max() <= DISTANCE
            assert (world >= np.array(solid.bounds.min) - DISTANCE).all()
            assert (world <= np.array(solid.bounds.max) + DISTANCE).all()
            continue
        planes = solid.half_spaces()
        values = at @ planes[:, :3].T - planes[:, 3]
        away = DISTANCE * np.linalg.norm(planes[:, :3], axis=1)
        assert (values <= away).all()
        on_plane = surface > 0
        own = values[on_plane, surface[on_plane] - 1]
        assert (np.abs(own) <= away[surface[on_plane] - 1]).all()
        if isinstance(solid, QuadricSolid):
            q = solid.quadric()
            homogeneous = np.concatenate([at, np.ones((len(at), 1))], axis=1)
            value = np.einsum("ni,ij,nj->n", homogeneous, q, homogeneous)
            slope = 2 * np.linalg.norm(homogeneous @ q[:, :3], axis=1)
            bound = DISTANCE * slope + DISTANCE**2 * np.abs(q[:3, :3]).sum()
            assert (value <= bound).all()
            assert (np.abs(value) <= bound)[~on_plane].all()
        else:
            assert on_plane.all()
    assert len(checked) >= 11


def test_normals_are_unit_and_point_out_of_the_solid(backend: str) -> None:
    frame, scene = gallery(backend), halfstep.load("gallery")
    hit = frame.solid >= 0
    np.testing.assert_allclose(np.linalg.norm(frame.normal[hit], axis=-1), 1, atol=1e-6)
    rays = frame.position - np.array(scene.camera.center)
    # Seen from outside, every surface faces the camera.
    assert (np.einsum("nk,nk->n", frame.normal[hit], rays[hit]) < 1e-3).all()
    for ix, solid in enumerate(scene.solids):
        if not isinstance(solid, QuadricSolid):
            continue
        here = (frame.solid == ix) & (frame.surface == 0)
        at = local(solid, frame.position[here])
        q = solid.quadric()
        gradient = (at @ q[:3, :3] + q[:3, 3]) @ solid.world_from_local().T
        length = np.linalg.norm(gradient, axis=1)
        clear = length > 0.05 * length.max(initial=0)
        expected = gradient[clear] / length[clear, None]
        np.testing.assert_allclose(frame.normal[here][clear], expected, atol=0.01)


def test_the_exit_is_not_before_the_entry(backend: str) -> None:
    frame, scene = gallery(backend), halfstep.load("gallery")
    hit = frame.solid >= 0
    assert (frame.depth_exit[hit] >= frame.depth[hit]).all()
    patch = np.isin(frame.solid, [i for i, s in enumerate(scene.solids) if s.kind == "plane"])
    np.testing.assert_array_equal(frame.depth_exit[patch], frame.depth[patch])
    # Through the middle of the ball the chord is its diameter.
    ball = next(ix for ix, solid in enumerate(scene.solids) if solid.name == "ball")
    chords = (frame.depth_exit - frame.depth)[frame.solid == ball]
    assert 0.75 < chords.max() < 1.0


@pytest.mark.parametrize("method", ["visible", "article"])
def test_a_camera_inside_sees_where_it_leaves(backend: str, method: str) -> None:
    scene = a_scene((0, -0.5, 0), {"kind": "sphere", "radius": 3})
    options: dict[str, Any] = {
        "size": (16, 12),
        "steps": STEPS,
        "backend": backend,
        "method": method,
    }
    frame = halfstep.render(scene, **options)
    assert (frame.solid == 0).all()
    np.testing.assert_array_equal(frame.depth_exit, frame.depth)
    np.testing.assert_allclose(np.linalg.norm(frame.position, axis=-1), 3, atol=DISTANCE)
    outward = np.einsum("hwk,hwk->hw", frame.normal, frame.position)
    np.testing.assert_allclose(outward, 3, atol=DISTANCE)


def test_the_exit_is_the_far_base_plane_where_the_ray_has_not_left(backend: str) -> None:
    volume = {"min": (-9, -9, -9), "max": (9, 0, 9)}
    scene = a_scene((0, -5, 0), {"kind": "sphere", "radius": 1}, volume=volume)
    frame = halfstep.render(scene, size=(33, 25), steps=STEPS, backend=backend)
    hit = frame.solid == 0
    assert 50 < hit.sum() < hit.size
    # The larger z of |h + z d| = 1.
    rays = (frame.position - (0, -5, 0)) / frame.depth[..., None]
    square = np.einsum("hwk,hwk->hw", rays, rays)[hit]
    own_exit = (5 + np.sqrt(25 - 24 * square)) / square
    np.testing.assert_allclose(frame.depth_exit[hit], np.minimum(own_exit, 5), atol=DISTANCE)
    beyond = own_exit > 5 + DISTANCE
    assert 50 < beyond.sum() < beyond.size
    np.testing.assert_array_equal(frame.depth_exit[hit][beyond], 5.0)
    assert frame.t[12, 16] == pytest.approx(0.8, abs=DISTANCE)


def test_the_error_bounds_the_depth(backend: str) -> None:
    frame = gallery(backend)
    options: dict[str, Any] = {"size": (WIDTH, HEIGHT), "camera": {"fov_degrees": 60}}
    fine = halfstep.render(
        halfstep.load("gallery"), steps=22, outputs=("depth", "error"), backend="numpy", **options
    )
    hit = frame.solid >= 0
    assert np.isin(frame.error[~hit], (0, np.inf)).all()
    assert (frame.error[hit] > 0).all()
    certified = np.isfinite(frame.error) & np.isfinite(fine.error)
    assert certified.mean() > 0.97
    # What is certified cannot be another solid, and two bounds of one depth overlap.
    both = certified & hit
    np.testing.assert_array_equal(frame.solid[certified] >= 0, fine.solid[certified] >= 0)
    apart = np.abs(frame.depth - fine.depth)[both]
    assert (apart <= (frame.error + fine.error)[both]).all()
    assert frame.error[both].max() < 10 * DISTANCE


def test_steps_are_those_of_the_solid_that_is_hit(backend: str) -> None:
    frame = gallery(backend)
    assert set(np.unique(frame.steps)) == {0, STEPS}
    np.testing.assert_array_equal(frame.steps > 0, frame.solid >= 0)


@pytest.mark.parametrize("name", sorted(bundled_scenes()))
def test_colors_and_normals_are_numbers(name: str) -> None:
    frame = halfstep.render(
        halfstep.load(name),
        size=(24, 18),
        steps=12,
        outputs=("image", "color", "normal"),
        backend="numpy",
    )
    assert np.isfinite(frame.color).all()
    assert np.isfinite(frame.normal).all()
    assert (frame.color >= 0).all()
    assert (frame.solid >= 0).any()


def test_a_scene_behind_the_camera_is_background(backend: str) -> None:
    scene = a_scene((0, -5, 0), {"kind": "sphere", "radius": 1, "origin": (0, -9, 0)})
    frame = halfstep.render(scene, size=(8, 6), backend=backend)
    assert (frame.solid == -1).all()
    for name, (_, _, value) in CONTRACT.items():
        if value is not None:
            np.testing.assert_array_equal(getattr(frame, name), value, err_msg=name)
    assert (frame.color == np.array(scene.image.background, np.float32)).all()


# ------------------------------------------------------------------------------ what is not there


def test_an_array_that_was_not_computed_names_outputs() -> None:
    frame = halfstep.render(
        halfstep.load("one_sphere"), size=(4, 3), outputs=("depth",), backend="numpy"
    )
    assert frame.outputs == ("solid", "depth")
    assert {"solid", "depth", "info"} <= set(dir(frame))
    assert "normal" not in dir(frame)
    with pytest.raises(AttributeError) as caught:
        _ = frame.normal
    assert (
        str(caught.value)
        == "'normal' was not computed; name it in outputs (this frame has: depth, solid)"
    )
    assert not hasattr(frame, "image")
    with pytest.raises(AttributeError) as caught:
        _ = frame.albedo
    assert str(caught.value) == "Frame has no attribute 'albedo'"


def test_frames_can_be_copied_and_sent() -> None:
    frame = halfstep.render(halfstep.load("one_sphere"), size=(4, 3), backend="numpy")
    for twin in (copy.deepcopy(frame), pickle.loads(pickle.dumps(frame))):
        assert twin.outputs == frame.outputs
        assert twin.info == frame.info
        for name in frame.outputs:
            np.testing.assert_array_equal(getattr(twin, name), getattr(frame, name))


@pytest.mark.parametrize(
    ("given", "checked"),
    [
        ((), ("solid",)),
        ("depth", ("solid", "depth")),
        (("normal", "image"), ("image", "solid", "normal")),
        (["t", "t"], ("solid", "t")),
        (OUTPUTS, tuple(OUTPUTS)),
    ],
)
def test_outputs_come_in_one_order_with_solid(given: Any, checked: tuple[str, ...]) -> None:
    assert check_outputs(given) == checked


def test_unknown_outputs_are_all_named() -> None:
    with pytest.raises(UsageError) as caught:
        check_outputs(("Z", "depth", "albedo"))
    assert str(caught.value) == f"outputs: 'Z', 'albedo' unknown; known are {', '.join(OUTPUTS)}"
    assert caught.value.exit_code == 2


def test_a_device_computes_only_what_is_asked_for() -> None:
    assert device_outputs(("solid",)) == {"surface"}
    assert device_outputs(("solid", "depth", "position", "t")) == {"surface", "key"}
    assert device_outputs(("image", "solid")) == {"surface", "image"}


@pytest.mark.parametrize("outputs", [("image", "depth"), ("solid",), ("color",)])
def test_a_frame_says_what_it_is(backend: str, outputs: tuple[str, ...]) -> None:
    frame = halfstep.render("figure", size=(32, 24), outputs=outputs, backend=backend)
    there = ", ".join(frame.outputs)
    assert {*outputs, "solid"} == set(frame.outputs)
    assert repr(frame) == f"<Frame of 32x24: {there}; on {frame.info['adapter']}>"


def test_a_notebook_shows_the_image() -> None:
    frame = halfstep.render("figure", size=(32, 24), outputs=("image",), backend="numpy")
    data = frame._repr_png_()
    assert data is not None
    np.testing.assert_array_equal(imageio.imread(data), frame.image)
    frame = halfstep.render("figure", size=(32, 24), outputs=("depth",), backend="numpy")
    assert frame._repr_png_() is None
