"""What is seen of OpenMC geometries is what an independent reading of the file says."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest

import halfstep
from halfstep.errors import SceneError
from halfstep.models import Look, load
from halfstep.models.openmc_reading import ROOTS
from tests.model_frames import STEPS, judged
from tests.openmc_oracle import Oracle

MODELS = Path(__file__).with_name("models")
SIZE = (60, 45)
# How far inside of what a clip leaves a point is.
LEFT = {
    ("x > 1 | y < -2",): lambda p: np.maximum(p[:, 0] - 1, -2 - p[:, 1]),
    ("y > 0",): lambda p: p[:, 1],
    ("z < 0",): lambda p: -p[:, 2],
    ("z < 0.3",): lambda p: 0.3 - p[:, 2],
    ("y > -0.5", "x <= 2"): lambda p: np.minimum(p[:, 1] + 0.5, 2 - p[:, 0]),
}


def openmc_folder() -> Path | None:
    """The folder of public models: as a variable says, or in a folder beside the project."""
    named = os.environ.get("HALFSTEP_OPENMC_MODELS")
    if named:
        return Path(named)
    beside = (folder / "shared" / "openmc" for folder in Path(__file__).resolve().parents)
    return next((folder for folder in beside if folder.is_dir()), None)


@pytest.mark.parametrize(
    ("name", "look", "least"),
    [
        ("syntax_children", Look(), 400),
        ("syntax_children", Look(clip=("x > 1 | y < -2",)), 300),
        ("model_only", Look(clip=("y > 0",)), 250),
        ("demorgan", Look(), 400),
        ("demorgan", Look(only=("material:1",)), 100),
        ("double_complement", Look(clip=("z < 0",)), 250),
        ("coincident", Look(hide=("material:3",)), 150),
        ("coincident", Look(clip=("z < 0.3",)), 300),
        ("hexagons", Look(clip=("y > -0.5", "x <= 2")), 150),
        ("hexagons", Look(hide=("water",)), 200),
        ("turned", Look(hide=("material:9",)), 200),
        ("quadrics", Look(), 200),
        ("tori", Look(hide=("void",)), 250),
        ("tori", Look(hide=("void",), clip=("z < 0.3",)), 200),
    ],
)
def test_frames_show_what_the_file_says(name: str, look: Look, least: int) -> None:
    path = MODELS / f"{name}.xml"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = load(path, look)
    found = judged(path, scene, SIZE, LEFT.get(look.clip))
    assert found["wrong"] == found["skipped"] == 0, found
    assert found["judged"] > least, found
    assert found["misses"] > 100, found


SLICE = """<plots><plot id="1" type="slice" basis="{basis}" color_by="cell">
<origin>{origin}</origin><width>{width} {width}</width><pixels>40 40</pixels></plot></plots>"""
# What is right of the picture, what is up, and where the viewer is.
BASES = {"xy": (0, 1, 2), "xz": (0, 2, 1), "yz": (1, 2, 0)}


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize(
    ("name", "origin", "width"),
    [
        ("hexagons", (0.07, 0.13, 0.11), 6.0),
        ("turned", (0.21, -0.16, 0.09), 5.0),
        ("quadrics", (0.3, 0.2, -0.1), 8.0),
        ("instances", (0.03, 0.02, 0.01), 5.0),
    ],
)
def test_a_slice_shows_the_cell_of_every_point(
    basis: str, name: str, origin: tuple[float, float, float], width: float, tmp_path: Path
) -> None:
    path, text = tmp_path / "geometry.xml", (MODELS / f"{name}.xml").read_text()
    numbers = " ".join(map(str, origin))
    plots = SLICE.format(basis=basis, origin=numbers, width=width)
    path.write_text(text.replace("</model>", f"{plots}</model>"))
    (tmp_path / "plots.xml").write_text(plots)
    scene = load(path, Look(plot=1))
    frame = halfstep.render(scene, backend="numpy", steps=STEPS, outputs=("cell", "depth"))
    right, up, _ = BASES[basis]
    rows, columns = np.mgrid[:40, :40]
    points = np.tile(np.array(origin), (1600, 1))
    points[:, right] += ((columns.ravel() + 0.5) / 40 - 0.5) * width
    points[:, up] -= ((rows.ravel() + 0.5) / 40 - 0.5) * width
    found, sure = Oracle(path, width).locate(points)
    sure = sure.reshape(40, 40)
    assert (frame.cell == found.reshape(40, 40))[sure].all()
    assert sure.sum() > 1400
    assert len(np.unique(frame.cell)) >= 2
    # What is shown lies in the plane.
    assert np.abs(frame.depth[frame.cell >= 0] - width).max() < 1e-3 * width


def test_the_oracle_finds_what_is_wrong() -> None:
    """A pin moved, and a cell left out."""
    path = MODELS / "model_only.xml"
    scene = load(path, Look(clip=("y > 0",)))
    group = scene.groups[1]
    [place] = group.places
    moved = group.model_copy(
        update={"places": (place.model_copy(update={"origin": (2.0, 0.0, 0.5)}),)}
    )
    other = scene.model_copy(update={"groups": (scene.groups[0], moved)})
    assert judged(path, other, SIZE)["wrong"] > 10


def test_materials_are_those_of_the_instance() -> None:
    with pytest.warns(UserWarning, match="nothing ends it along z; shown is -0.5 to 0.5"):
        scene = load(MODELS / "instances.xml", Look(view="xy"))
    frame = halfstep.render(scene, size=(40, 40), backend="numpy", outputs=("material", "cell"))
    rows, columns = np.array([[12, 12], [28, 28]]), np.array([[12, 28], [12, 28]])
    # OpenMC counts the elements of a lattice from the lowest row up.
    assert frame.material[rows, columns].tolist() == [[13, 14], [11, 12]]
    assert (frame.cell[rows, columns] == 8).all()
    assert set(np.unique(frame.material)) == {-1, 5, 11, 12, 13, 14}


def test_all_public_models_open_or_say_why_not() -> None:
    folder = openmc_folder()
    if folder is None:
        pytest.skip("there is no folder of public models: HALFSTEP_OPENMC_MODELS names one")
    opened = 0
    refused: dict[str, str] = {}
    for path in sorted(folder.glob("*.xml")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                scene = load(path)
                opened += 1
            except SceneError as error:
                refused[path.name] = str(error)
                continue
        assert scene.cells
    assert opened >= 30
    assert len(refused) >= 2
    for name, message in refused.items():
        text = (folder / name).read_text(encoding="utf-8")
        is_geometry = any(f"<{root}" in text for root in ROOTS)
        assert not is_geometry or "surfaces: is of" in message
    for path in sorted((folder / "errors").glob("*.xml")):
        with pytest.raises(SceneError) as caught:
            load(path)
        assert all(fault.startswith(f"{path.name}: line ") for fault in caught.value.faults)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["hmf012", "imf001_1", "complex_cell", "adj_cell_rotation", "lattice_hex_coincident"]
)
def test_public_models_show_what_the_file_says(name: str) -> None:
    folder = openmc_folder()
    if folder is None:
        pytest.skip("there is no folder of public models: HALFSTEP_OPENMC_MODELS names one")
    path = folder / f"{name}.xml"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = load(path, Look(clip=("x > 0",)))
    found = judged(path, scene, SIZE, lambda points: points[:, 0])
    assert found["wrong"] == found["skipped"] == 0, found
    assert found["judged"] > 150, found
