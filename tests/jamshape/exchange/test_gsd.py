import numpy as np
import pytest
from exchanged import PLACES, assert_same, mixed, tilted
from nasty import tilted_box, with_rests

from jamshape.exchange.gsd import read_gsd, write_gsd
from jamshape.files.h5md import FileFormatError
from jamshape.shapes.table import SHAPES

hoomd = pytest.importorskip("gsd.hoomd")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "packing.gsd"


def native(path, frame=0):
    """A frame as every other program sees it."""
    with hoomd.open(str(path)) as file:
        return file[frame]


@pytest.mark.parametrize(("name", "dimension"), PLACES)
def test_a_packing_is_read_back_to_the_last_bit(path, name, dimension):
    packing = mixed(name, dimension)
    write_gsd(path, packing)
    assert_same(read_gsd(path), packing)


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_doubles_leave_out_is_kept(path, dimension):
    packing = with_rests(dimension)
    write_gsd(path, packing)
    assert packing.has_rests
    assert_same(read_gsd(path), packing)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_tilt_is_kept_and_other_programs_see_it(path, dimension):
    packing, D = tilted("spherocylinder", dimension), dimension
    plain = mixed("spherocylinder", dimension)
    fine = with_rests(dimension, box=tilted_box(dimension))
    frames = [packing, plain.with_(step=1), fine, plain.with_(step=2)]
    write_gsd(path, frames)
    for k, one in enumerate(frames):
        assert_same(read_gsd(path, k), one)
    frame = native(path, 0)
    lx, ly, lz, xy, xz, yz = frame.configuration.box
    matrix = np.array([[lx, xy * ly, xz * lz], [0, ly, yz * lz], [0, 0, lz]])
    np.testing.assert_allclose(matrix[:D, :D], packing.box.matrix, rtol=1e-6)
    inside = np.linalg.solve(packing.box.matrix, frame.particles.position[:, :D].T)
    assert np.abs(inside).max() <= 0.5 + 1e-6
    # Each particle is where it was.
    been = frame.particles.position + frame.particles.image @ matrix.T
    moved = packing.position + packing.box.vectors(packing.image) - packing.box.center
    np.testing.assert_allclose(been[:, :D], moved, rtol=0, atol=4e-6 * np.abs(moved).max())


def test_frames_are_packings_of_their_own(path):
    plain = mixed("spherocylinder", 2)
    position, orientation, cell = (x + np.longdouble(1e-20) for x in plain.poses())
    fine = plain.with_poses(position, orientation, np.diag(np.diag(cell)))
    frames = [plain, fine.with_(step=5), mixed("dimer", 2, n=7), plain.with_(step=9)]
    frames[1] = fine
    write_gsd(path, frames)
    for k, packing in enumerate(frames):
        assert_same(read_gsd(path, k), packing)
    assert_same(read_gsd(path, -3), fine)
    assert fine.has_rests
    with pytest.raises(ValueError, match="has 4 frames, expected frame 4 to be one of them"):
        read_gsd(path, 4)


@pytest.mark.parametrize(("name", "dimension"), PLACES)
def test_other_programs_see_a_box_around_0_with_all_particles_in_it(path, name, dimension):
    packing = mixed(name, dimension)
    write_gsd(path, packing)
    frame, D = native(path), dimension
    assert frame.configuration.dimensions == D
    assert frame.configuration.step == packing.step
    box = frame.configuration.box
    np.testing.assert_array_equal(box[:D], packing.box.edges.astype(np.float32))
    np.testing.assert_array_equal(box[D:], 0)
    position = frame.particles.position[:, :D]
    assert (np.abs(position) <= box[:D] / 2).all()
    if D == 2:
        assert not frame.particles.position[:, 2].any()
    been = position + frame.particles.image[:, :D] * packing.box.edges
    middle = packing.box.lo + packing.box.edges / 2
    unwrapped = packing.position + packing.image * packing.box.edges - middle
    np.testing.assert_allclose(been, unwrapped, atol=2e-6 * np.abs(unwrapped).max())
    np.testing.assert_allclose(frame.particles.orientation, packing.quaternions, atol=1e-7)


@pytest.mark.parametrize(("name", "dimension"), PLACES)
def test_a_type_is_a_species_and_its_shape_has_the_size_of_the_particles(path, name, dimension):
    packing = mixed(name, dimension, spread=0)
    write_gsd(path, packing)
    particles = native(path).particles
    species = [particles.types[k] for k in particles.typeid]
    assert species == packing.species.astype(str).tolist()
    for i, k in enumerate(particles.typeid):
        reach = reach_of(particles.type_shapes[k], dimension)
        assert reach == pytest.approx(packing.outer_radius[i], rel=2e-3)
        assert reach <= packing.outer_radius[i] * (1 + 1e-6)


def reach_of(shape, dimension):
    """Largest distance of a body's surface from its centre, in the plane or in space."""
    match shape["type"]:
        case "Sphere":
            return shape["diameter"] / 2
        case "Ellipsoid":
            return max(shape[axis] for axis in "abc"[:dimension])
        case "SphereUnion":
            away = np.linalg.norm(shape["centers"], axis=1)
            return (away + np.array(shape["diameters"]) / 2).max()
        case "Polygon":
            return np.linalg.norm(shape["vertices"], axis=1).max() + shape["rounding_radius"]
        case "Mesh":
            return np.linalg.norm(np.array(shape["vertices"])[:, :dimension], axis=1).max()


def test_bodies_are_named_by_what_they_are(path):
    found = {}
    for name in SHAPES:
        write_gsd(path, mixed(name, SHAPES[name].dimensions[-1], spread=0))
        found[name] = {shape["type"] for shape in native(path).particles.type_shapes}
    assert found["spherocylinder"] == {"Mesh", "Sphere"}
    assert found["dimer"] == {"SphereUnion"}
    assert found["clump"] == {"SphereUnion"}
    assert found["spheropolygon"] == {"Polygon"}
    assert found["superellipsoid"] == {"Mesh", "Ellipsoid", "Sphere"}


def test_corners_of_rods_lie_on_their_surface(path):
    packing = mixed("spherocylinder", 2, spread=0)
    write_gsd(path, packing)
    particles = native(path).particles
    meshes = [(i, particles.type_shapes[k]) for i, k in enumerate(particles.typeid)]
    meshes = [(i, shape) for i, shape in meshes if shape["type"] == "Mesh"]
    assert meshes
    for i, shape in meshes:
        corners, A = np.array(shape["vertices"]), packing.half_length[i]
        spine = np.column_stack([corners[:, 0].clip(-A, A), np.zeros((len(corners), 2))])
        distance = np.linalg.norm(corners - spine, axis=1)
        np.testing.assert_allclose(distance, packing.radius[i], rtol=1e-6)


def test_many_sizes_are_many_types(path):
    packing = mixed("superellipsoid", 3, n=20)
    write_gsd(path, packing)
    types = native(path).particles.types
    assert len(types) == len(set(types)) == 20
    assert {name.split(".")[0] for name in types} == set(packing.species.astype(str))


def test_bad_files_and_packings_are_told_in_a_sentence(path, tmp_path):
    with pytest.raises(ValueError, match=r"in \[2, 3\] dimensions, expected one or more"):
        write_gsd(path, [mixed("dimer", 2), mixed("dimer", 3)])
    with pytest.raises(ValueError, match=r"in \[\] dimensions"):
        write_gsd(path, [])
    assert not list(tmp_path.iterdir())
    path.write_text("text\n" * 100)
    with pytest.raises(FileFormatError, match="expected a GSD file"):
        read_gsd(path)
    with hoomd.open(str(path), "w") as file:
        frame = hoomd.Frame()
        frame.particles.N = 1
        file.append(frame)
    with pytest.raises(FileFormatError, match="no log/jamshape of a packing"):
        read_gsd(path)
    with pytest.raises(FileNotFoundError):
        read_gsd(tmp_path / "nowhere.gsd")


def edited(path, change):
    """Read a file of ours as another program does, change its frame, and write all of it."""
    out = path.with_name("edited.gsd")
    with hoomd.open(path) as old, hoomd.open(out, "w") as new:
        frame = old[0]
        change(frame)
        new.append(frame)
    return out


@pytest.mark.parametrize(("name", "dimension"), PLACES)
def test_a_file_that_another_program_scaled_is_as_that_left_it(path, name, dimension):
    packing = mixed(name, dimension)
    write_gsd(path, packing)

    def scale(frame):
        frame.particles.position = frame.particles.position * 1.1
        box = frame.configuration.box.copy()
        box[:dimension] *= 1.1
        frame.configuration.box = box

    found = read_gsd(edited(path, scale))
    assert found.phi == pytest.approx(packing.phi / 1.1**dimension, rel=1e-6)
    np.testing.assert_allclose(found.box.edges, 1.1 * packing.box.edges, rtol=1e-6)
    there, here = (x.position - x.box.center + x.image * x.box.edges for x in (found, packing))
    np.testing.assert_allclose(there, 1.1 * here, atol=1e-5 * np.abs(here).max())
    np.testing.assert_array_equal(found.orientation, packing.orientation)
    assert found.law == packing.law


@pytest.mark.parametrize("dimension", [2, 3])
def test_only_what_was_changed_is_in_single_precision(path, dimension):
    packing = mixed("spherocylinder", dimension)
    write_gsd(path, packing)

    def move_and_turn(frame):
        frame.particles.position[3, 0] += 0.01
        frame.particles.orientation[5] = [0.5**0.5, 0, 0, 0.5**0.5]
        frame.particles.orientation[6] *= -1  # the same rotation

    found = read_gsd(edited(path, move_and_turn))
    moved = np.arange(packing.n) == 3
    assert (found.position[~moved] == packing.position[~moved]).all()
    shift = found.box.fractions(found.position[3] - packing.position[3])
    shift = found.box.vectors(shift - np.rint(shift))
    assert shift[0] == pytest.approx(0.01, abs=1e-5)
    turned = np.arange(packing.n) == 5
    assert (found.orientation[~turned] == packing.orientation[~turned]).all()
    np.testing.assert_allclose(found.axes[5, :2], [0, 1], atol=1e-6)


def test_a_particle_in_another_image_of_the_box_is_where_it_was(path):
    packing = mixed("dimer", 2)
    write_gsd(path, packing)

    def wrap(frame):
        frame.particles.position[2, 0] += frame.configuration.box[0]
        frame.particles.image[2, 0] -= 1

    assert_same(read_gsd(edited(path, wrap)), packing)

    def count(frame):
        frame.particles.image[2, 1] += 4

    found = read_gsd(edited(path, count))
    assert (found.position == packing.position).all()
    assert (found.image - packing.image).sum() == 4 == (found.image - packing.image)[2, 1]


def test_other_kinds_of_particles_are_refused(path):
    write_gsd(path, mixed("spherocylinder", 2))

    def rename(frame):
        frame.particles.typeid = frame.particles.typeid[::-1].copy()

    def grow(frame):
        frame.particles.type_shapes = [
            {"type": "Sphere", "diameter": 9.0} for _ in frame.particles.type_shapes
        ]

    for change in (rename, grow):
        with pytest.raises(FileFormatError, match="another program has changed types of particles"):
            read_gsd(edited(path, change))
