import numpy as np
import pytest
from exchanged import PLACES, mixed, tilted
from scenes import pressed, scaled
from written import write_content

from jamshape.contacts import find_contacts
from jamshape.exchange.mdanalysis import to_mdanalysis, write_mdanalysis
from jamshape.files.h5md import write_run

MDAnalysis = pytest.importorskip("MDAnalysis")

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning:MDAnalysis")

TIMES = [0.0, 0.3, 2.0]


def run(dimension):
    """Frames in a box that shrinks, at times that are not evenly spaced."""
    first = pressed(dimension=dimension).with_(time=0.0)
    return [
        scaled(first, 1 - 0.01 * k).with_(step=10 * k, time=time) for k, time in enumerate(TIMES)
    ]


@pytest.fixture
def run_file(tmp_path, request):
    frames = run(request.param)
    write_content(tmp_path / "run.h5", frames, rows=[(0, 0.0, {"phi": frames[0].phi})])
    return tmp_path / "run.h5", frames


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("how", [{}, {"convert_units": False}])
def test_which_of_our_own_files_it_opens(tmp_path, dimension, how):
    """Runs in space, without units, as stated on the page on files."""
    frames = run(dimension)
    write_run(tmp_path / "run.h5", frames)
    universe = MDAnalysis.Universe.empty(frames[0].n, trajectory=True)
    if dimension == 3 and how:
        universe.load_new(str(tmp_path / "run.h5"), format="H5MD", **how)
        assert [ts.time for ts in universe.trajectory] == TIMES
        last = universe.trajectory[-1].positions
        np.testing.assert_allclose(last, frames[-1].position, rtol=1e-6)
    else:
        with pytest.raises(ValueError, match=r"3-dimensional simulation boxes|readable units"):
            universe.load_new(str(tmp_path / "run.h5"), format="H5MD", **how)


def assert_is_the_run(universe, frames):
    assert universe.trajectory.n_frames == len(frames)
    for packing, ts in zip(frames, universe.trajectory, strict=True):
        D = packing.dimension
        assert (ts.time, ts.data["step"]) == (packing.time, packing.step)
        height = [1.0] * (3 - D)
        np.testing.assert_allclose(ts.dimensions, [*packing.box.edges, *height, 90, 90, 90])
        expected = packing.position - packing.box.lo
        np.testing.assert_allclose(ts.positions[:, :D], expected, rtol=1e-6, atol=1e-5)
        assert not ts.positions[:, D:].any()
        np.testing.assert_array_equal(ts.data["orientation"], packing.quaternions)


@pytest.mark.parametrize("run_file", [2, 3], indirect=True)
def test_a_run_file_is_a_trajectory_of_all_its_frames(run_file):
    path, frames = run_file
    assert_is_the_run(to_mdanalysis(path), frames)
    assert_is_the_run(to_mdanalysis(str(path)), frames)
    assert_is_the_run(to_mdanalysis(frames), frames)


@pytest.mark.parametrize("run_file", [2, 3], indirect=True)
def test_mdanalysis_opens_the_written_file_by_itself(run_file, tmp_path):
    path, frames = run_file
    write_mdanalysis(tmp_path / "run.h5md", path)
    assert_is_the_run(MDAnalysis.Universe(tmp_path / "run.h5md", to_guess=()), frames)
    universe = to_mdanalysis(path, tmp_path / "again.h5md")
    assert_is_the_run(universe.copy(), frames)


@pytest.mark.parametrize(("name", "dimension"), PLACES)
def test_the_topology_names_the_particles(name, dimension):
    packing = mixed(name, dimension)
    atoms = to_mdanalysis(packing).atoms
    np.testing.assert_array_equal(atoms.ids, packing.id)
    np.testing.assert_array_equal(atoms.resids, packing.id)
    assert atoms.types.tolist() == packing.species.astype(str).tolist()
    assert set(atoms.names) == set(atoms.resnames) == {name}
    np.testing.assert_array_equal(atoms.radii, packing.outer_radius)
    np.testing.assert_array_equal(atoms.masses, packing.measures)
    chosen = atoms.select_atoms("type 1")
    np.testing.assert_array_equal(chosen.ids, packing.id[packing.species == 1])


@pytest.mark.parametrize("dimension", [2, 3])
def test_distances_around_the_box_are_those_of_our_contacts(dimension):
    packing = pressed(dimension=dimension)
    network = find_contacts(packing)
    distance = np.linalg.norm(network.separation, axis=1)
    near = distance < packing.box.edges.min() / 2
    assert network.shift[near].any()
    atoms = to_mdanalysis(packing).atoms
    i, j = network.pairs[near].T
    found = MDAnalysis.lib.distances.calc_bonds(
        atoms.positions[i], atoms.positions[j], box=atoms.dimensions
    )
    np.testing.assert_allclose(found, distance[near], rtol=1e-5)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_box_with_a_tilt_is_that_of_mdanalysis(dimension):
    plain, packing = mixed("dimer", dimension), tilted("dimer", dimension)
    universe = to_mdanalysis([plain.with_(step=0), packing.with_(step=1)])
    matrices = [np.array(ts.triclinic_dimensions) for ts in universe.trajectory]
    D = dimension
    for rows, one in zip(matrices, (plain, packing), strict=True):
        # Edge vectors are its rows, of angles in single precision.
        atol = 1e-5 * one.box.edges.max()
        np.testing.assert_allclose(rows[:D, :D], one.box.matrix.T, rtol=0, atol=atol)
    universe.trajectory[1]
    atoms = universe.atoms
    i, j = np.triu_indices(packing.n, 1)
    found = MDAnalysis.lib.distances.calc_bonds(
        atoms.positions[i], atoms.positions[j], box=atoms.dimensions
    )
    apart = packing.position[i] - packing.position[j]
    shifts = np.array(list(np.ndindex(*[5] * D))) - 2
    apart -= packing.box.vectors(np.rint(packing.box.fractions(apart)))
    images = apart[:, None] + packing.box.vectors(shifts)
    nearest = np.linalg.norm(images, axis=2).min(axis=1)
    np.testing.assert_allclose(found, nearest, rtol=0, atol=1e-4)


def test_frames_of_other_particles_are_refused(tmp_path):
    packing = mixed("dimer", 2)
    with pytest.raises(ValueError, match="frame 1 differs from the first one in id"):
        write_mdanalysis(tmp_path / "x.h5md", [packing, packing.sorted_by_id()])
    with pytest.raises(ValueError, match="there is no packing"):
        write_mdanalysis(tmp_path / "x.h5md", [])
    assert not list(tmp_path.iterdir())
