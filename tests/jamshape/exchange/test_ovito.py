import numpy as np
import pytest
from exchanged import PLACES, assert_same, mixed, tilted, touching
from matplotlib.colors import to_rgb
from mixtures import bidisperse
from nasty import with_rests
from scenes import pressed

from jamshape.drawing.colors import of_kinds
from jamshape.drawing.styles import KINDS, RATTLER
from jamshape.exchange.gsd import write_gsd
from jamshape.exchange.ovito import from_ovito, to_ovito
from jamshape.files.h5md import FileFormatError
from jamshape.packing.rotation import product
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Kind, Particles
from jamshape.shapes.shape import Interaction
from jamshape.shapes.table import SHAPES

pytest.importorskip("ovito")

from ovito.data import DataCollection
from ovito.io import import_file
from ovito.pipeline import Pipeline, StaticSource
from ovito.vis import TachyonRenderer, Viewport

WIDE, DOTS = 0.5, 400  # of a picture around a contact, [length] and dots
DOT = WIDE / DOTS


def picture_of(data, middle, wide=WIDE, up=(0.0, 1.0, 0.0), toward=(0.0, 0.0, -1.0)):
    """(DOTS, DOTS) where something is seen from afar; the first row is the lowest."""
    data.cell.vis.enabled = False
    pipeline = Pipeline(source=StaticSource(data=data))
    pipeline.add_to_scene()
    view = Viewport(type=Viewport.Type.Ortho, camera_dir=toward, camera_up=up)
    view.camera_pos, view.fov = tuple(three(middle) - 50 * np.array(toward)), wide / 2
    renderer = TachyonRenderer(ambient_occlusion=False, shadows=False, antialiasing=False)
    try:
        image = view.render_image(size=(DOTS, DOTS), renderer=renderer, alpha=True)
    except RuntimeError as error:
        if "Vulkan" not in str(error):
            raise
        pytest.skip("this OVITO draws nothing without libvulkan1 and mesa-vulkan-drivers")
    finally:
        pipeline.remove_from_scene()
    rows = np.frombuffer(image.bits(), np.uint8).reshape(DOTS, DOTS, 4)
    return rows[::-1, :, 3] > 0


def three(vector):
    return np.pad(vector, (0, 3 - len(vector)))


def seen_between(packing, point, normal):
    """Pixels on a line through a contact along its normal, with the plane of contact edge-on."""
    up = three(normal)
    across = np.cross(up, [0.0, 0.0, 1.0]) if packing.dimension == 3 else np.array([0.0, 0.0, -1.0])
    toward = tuple(across / np.linalg.norm(across))
    return picture_of(to_ovito(packing), point, up=tuple(up), toward=toward)[:, DOTS // 2]


def moved_apart(packing, normal, gap):
    """The first particle moved along the normal into it."""
    shift = np.array([gap * normal, np.zeros(packing.dimension)])
    return packing.with_(position=packing.position + shift)


TURNS = [[0.8, 0.6, 0.0, 0.0], [0.5, -0.1, 0.7, 0.5]]
POSES = [(name, angles) for name in SHAPES for angles in ([0.3, 1.2], [0.4, 0.4], [2.0, -0.5])]
POSES += [(name, TURNS) for name in ("spherocylinder", "superellipsoid")]  # no part hides another


@pytest.mark.parametrize(("name", "orientations"), POSES)
def test_particles_touch_where_they_touch(name, orientations, measured):
    packing, point, normal = touching(name, orientations)
    deep = 0.01 * packing.diameters.min()
    assert seen_between(moved_apart(packing, normal, -deep), point, normal).all()
    for gap in (0.02, 0.05):
        apart = moved_apart(packing, normal, gap)
        seen = seen_between(apart, point + normal * gap / 2, normal)
        length = np.count_nonzero(~seen) * DOT
        measured(**{f"gap_{gap}": length})
        assert length == pytest.approx(gap, abs=2 * DOT)
        assert seen[[0, -1]].all()


@pytest.mark.parametrize("name", SHAPES)
def test_the_area_seen_is_that_of_the_particles(name, measured):
    packing = mixed(name, 2, n=6)
    box = packing.box
    packing = packing.with_(position=box.lo + (packing.position - box.lo) % box.edges)
    wide = float(box.edges.max() + 4 * packing.outer_radius.max())
    seen = picture_of(to_ovito(packing), box.lo + box.edges / 2, wide)
    area = np.count_nonzero(seen) * (wide / DOTS) ** 2
    measured(area=area / packing.measures.sum())
    assert area == pytest.approx(packing.measures.sum(), rel=0.02)


@pytest.mark.parametrize("name", SHAPES)
def test_ovito_draws_the_same_of_our_gsd_file(name, tmp_path):
    packing = mixed(name, 2, n=6)
    box = packing.box
    inside = packing.with_(position=box.lo + (packing.position - box.lo) % box.edges)
    write_gsd(tmp_path / "packing.gsd", packing)
    read = import_file(str(tmp_path / "packing.gsd")).compute()
    wide = float(box.edges.max() + 4 * packing.outer_radius.max())
    there = picture_of(read, (0.0, 0.0), wide)
    ours = picture_of(to_ovito(inside), box.lo + box.edges / 2, wide)
    assert np.count_nonzero(ours) > 1000
    assert np.count_nonzero(there != ours) < 0.03 * np.count_nonzero(ours)


@pytest.mark.parametrize(("name", "dimension"), PLACES)
@pytest.mark.parametrize("make", [mixed, tilted])
def test_a_packing_is_read_back_to_the_last_bit(make, name, dimension):
    packing = make(name, dimension)
    data = to_ovito(packing)
    cell = np.asarray(data.cell[...])
    np.testing.assert_array_equal(cell[:dimension, :dimension], packing.box.matrix)
    assert_same(from_ovito(data), packing)


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_doubles_leave_out_is_kept(dimension):
    packing = with_rests(dimension)
    assert_same(from_ovito(to_ovito(packing)), packing)


def test_positions_are_those_that_ovito_has_now():
    packing = mixed("spherocylinder", 3)
    data = to_ovito(packing)
    data.particles_.positions_[...] += 1.0
    found = from_ovito(data)
    np.testing.assert_array_equal(found.position, packing.position + 1.0)


def test_data_of_others_are_refused_in_a_sentence():
    with pytest.raises(FileFormatError, match="expected data from to_ovito"):
        from_ovito(DataCollection())


@pytest.mark.parametrize("dimension", [2, 3])
def test_properties_are_those_that_ovito_draws(dimension):
    rods = mixed("spherocylinder", dimension)
    particles = to_ovito(rods).particles
    width, length = rods.radius, 2 * rods.half_length
    expected = np.column_stack([width, width, length])
    np.testing.assert_allclose(particles["Aspherical Shape"], expected, rtol=1e-6)
    assert {str(t.shape).split(".")[-1] for t in particles.particle_types.types} == {
        "Spherocylinder"
    }
    bodies = mixed("superellipsoid", dimension)
    particles = to_ovito(bodies).particles
    np.testing.assert_allclose(particles["Aspherical Shape"], bodies.diameters / 2, rtol=1e-6)
    roundness = 2 / bodies.form
    assert np.ptp(roundness, axis=1).max() > 0
    np.testing.assert_allclose(particles["Superquadric Roundness"], roundness, rtol=1e-6)
    expected = bodies.quaternions[:, [1, 2, 3, 0]]
    np.testing.assert_allclose(particles["Orientation"], expected, atol=1e-7)
    assert "Superquadric Roundness" not in to_ovito(rods).particles


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_cell_is_the_box(dimension):
    packing = mixed("dimer", dimension)
    cell = to_ovito(packing).cell
    assert (cell.is2D, tuple(cell.pbc)) == (dimension == 2, (True, True, dimension == 3))
    np.testing.assert_array_equal(cell[:dimension, 3], packing.box.lo)
    np.testing.assert_array_equal(np.diag(cell[:, :3])[:dimension], packing.box.edges)


def test_kinds_have_the_colours_of_our_pictures():
    packing = pressed(mixture=bidisperse())
    particles = to_ovito(packing).particles
    types = particles.particle_types.types
    assert [t.name for t in types] == ["alpha 4, 2R 1", "alpha 4, 2R 1.4"]
    np.testing.assert_allclose([t.color for t in types], [to_rgb(c) for c in KINDS[:2]])
    of = np.asarray(particles.particle_types)
    np.testing.assert_array_equal(of - 1, packing.radius > packing.radius.min())
    assert "Color" not in particles


def test_rattlers_are_grey_and_many_sizes_shaded_as_in_our_pictures():
    packing = pressed()
    rattlers = np.arange(packing.n) % 3 == 0
    colors = to_ovito(packing, rattlers).particles.colors
    expected = of_kinds(packing, rattlers).rgb
    np.testing.assert_allclose(colors, expected, atol=1e-6)
    np.testing.assert_allclose(colors[0], to_rgb(RATTLER), atol=1e-6)
    kinds = Particles.mixture("dimer", [Kind({"alpha": 1.0}, spread=0.05)])
    many = random_packing(20, 0.3, 1, kinds)
    found = to_ovito(many).particles
    expected = of_kinds(many, np.zeros(20, bool)).rgb
    assert len(np.unique(expected, axis=0)) > 10
    np.testing.assert_allclose(found.colors, expected, atol=1e-6)
    [one] = found.particle_types.types
    assert one.name.startswith("alpha 1, 2R 0.")


def test_a_dump_of_ours_tells_ovito_shape_and_roundness(tmp_path):
    columns = "quatw quati quatj quatk shapex shapey shapez"
    columns += " exponent SuperquadricRoundness.Phi SuperquadricRoundness.Theta"
    values = "0.1 0.7 0.5 0.5 2 2.4 3 1.5 0.66666666666666663 0.66666666666666663"
    path = tmp_path / "particles.dump"
    path.write_text(
        "ITEM: TIMESTEP\n7\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS pp pp pp\n"
        f"0 9\n0 9\n0 9\nITEM: ATOMS id type x y z {columns}\n1 1 2 3 4 {values}\n"
    )
    particles = import_file(str(path)).compute().particles
    np.testing.assert_allclose(particles["Superquadric Roundness"], [[2 / 3, 2 / 3]], rtol=1e-6)
    np.testing.assert_allclose(particles["Aspherical Shape"], [[1, 1.2, 1.5]], rtol=1e-6)
    np.testing.assert_allclose(particles["Orientation"], [[0.7, 0.5, 0.5, 0.1]], rtol=1e-6)


@pytest.mark.parametrize(("name", "dimension"), PLACES)
def test_what_was_turned_in_ovito_comes_back_turned(name, dimension):
    packing = mixed(name, dimension).with_(law=Interaction(2.5, 1))
    data = to_ovito(packing)
    assert from_ovito(data).law == packing.law
    quarter = (0.5**0.5, 0.0, 0.0, 0.5**0.5)  # about z
    with data.particles_.orientations_ as orientations:
        w, x, y, z = product(quarter, np.array(orientations)[:1, [3, 0, 1, 2]])[0]
        orientations[0] = (x, y, z, w)
    found = from_ovito(data)
    x, y, *rest = packing.axes[0]
    np.testing.assert_allclose(found.axes[0], [-y, x, *rest], atol=1e-6)
    assert (found.orientation[1:] == packing.orientation[1:]).all()
