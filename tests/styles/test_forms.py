"""Forms of types in decks: files of numbers, create_random, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from lammps_runs import before_box, error_of, load_plugin, run_lmp, run_lmp_well, scene
from pair_scenes import packing_of
from thinned import in_turn

pytestmark = pytest.mark.lammps

CASES = [
    "clump-2D-mixture",
    "clump-3D-mixture",
    "spheropolygon-2D-mixture",
    "superellipsoid-3D-mixture",
]
SHOWN = "thermo_style custom pe pxx pxy\nthermo_modify format float %.17g\nrun 0"
SQUARE = "0.5 -0.5 -0.5 0.5 -0.5 0.5 0.5 -0.5 0.5"  # rounding radius, corners


def shown(done):
    """The row of numbers behind the header of thermo."""
    return re.search(r"PotEng.*\n(.*)", done)[1].split()


@pytest.mark.parametrize(("name", "ranks"), in_turn(CASES, [2, 1]))
def test_numbers_in_a_file_are_those_in_the_line(name, ranks, tmp_path):
    text = f"{load_plugin()}\n{scene(packing_of(name), tmp_path / 's.data')}"
    lines, n_files = [], 0
    for line in text.splitlines():
        words = line.split()
        if words[:1] == ["pair_coeff"] and len(words) > 4:
            path = tmp_path / f"form{words[1]}.txt"
            rows = [" ".join(words[k : k + 4]) for k in range(4, len(words), 4)]
            path.write_text("# of one type\n" + "  # so many\n".join(rows) + "\n")
            lines.append(f"{' '.join(words[:4])} {path.name}")
            n_files += 1
        else:
            lines.append(line)
    assert n_files > 1
    one, other = (run_lmp_well(f"{x}\n{SHOWN}", tmp_path, ranks) for x in (text, "\n".join(lines)))
    assert shown(one) == shown(other)
    assert float(shown(one)[0]) > 0


@pytest.mark.parametrize(
    ("style", "numbers", "message"),
    [
        ("clump/harmonic", "0 0 0 0.5 1 0 0 0.5", r"centre of area at 0"),
        ("clump/harmonic", "0 0 0", r"x y z r of each disc"),
        ("clump/harmonic", "0 0 0 -0.5", r"x y z r of each disc"),
        ("spheropolygon/harmonic sides two", "0.5 0 0 1 0 0 1", r"centre of area of the body at 0"),
        ("spheropolygon/harmonic sides two", "0.5 -0.5 0.5 0.5 0.5 0.5 -0.5 -0.5 -0.5", "counter-clockwise"),
        ("spheropolygon/harmonic sides two", "0 -0.5 0 0.5 0", "a rounding radius"),
        ("clump/harmonic", "no_such_file.txt", "no_such_file.txt"),
        ("superellipsoid/harmonic", "5 0.9", "n1 n2 above 1"),
        ("superellipsoid/harmonic", "5 3 2", "n1 = n2 = 2p is the same body"),
        ("clump/harmonic", "words.txt", "found 'no' in words.txt, expected numbers alone"),
    ],
)  # fmt: skip
def test_other_numbers_are_refused_in_a_sentence(style, numbers, message, tmp_path):
    (tmp_path / "words.txt").write_text("0 0 0 0.5\nno\n")
    deck = f"""
        {before_box(2)}
        {load_plugin()}
        region box block 0 9 0 9 -0.5 0.5
        create_box 1 box
        pair_style {style}
        pair_coeff 1 1 1.0 {numbers}"""
    assert re.search(message, error_of(run_lmp(deck, tmp_path)))


@pytest.mark.parametrize(
    ("shape", "kinds", "coefficients"),
    [
        ("clump", "type 1 2 1 1 form -0.5 0 0 0.5 0.5 0 0 0.5", "1 1 1.0 -0.5 0 0 0.5 0.5 0 0 0.5"),
        ("spheropolygon", f"type 1 2 2 1 form {SQUARE}", f"1 1 1.0 {SQUARE}"),
        ("superellipsoid", "type 1 2 2 2 form 1.5", "1 1 1.0 1.5"),
        ("superellipsoid", "type 1 2 2 2 exponent 1.5", "1 1 1.0 1.5"),
        ("superellipsoid", "type 1 2 2 2 form 5 1.6", "1 1 1.0 5 1.6"),
    ],
)  # fmt: skip
def test_random_particles_of_a_form_do_not_overlap(shape, kinds, coefficients, tmp_path):
    sides = " sides two" if shape == "spheropolygon" else ""
    done = run_lmp_well(
        f"""
        {before_box(2)}
        {load_plugin()}
        create_random {shape} 40 0.3 3 {kinds}
        pair_style {shape}/harmonic{sides}
        pair_coeff {coefficients}
        {SHOWN}""",
        tmp_path,
    )
    assert "Created 40 particles at random" in done
    assert float(shown(done)[0]) == 0.0


@pytest.mark.parametrize("exponents", ["5 1.6", "1.5 6", "20 2"])
def test_energy_is_conserved_by_motion_with_inertia(exponents, tmp_path, measured):
    """Its fluctuation falls with the time step: as its square, or more slowly where edges, which are sharp, touch."""

    def fluctuation(steps):
        done = run_lmp_well(
            f"""
            {before_box(3)}
            {load_plugin()}
            create_random superellipsoid 16 0.3 3 type 1 1 1 1.4 form {exponents}
            pair_style superellipsoid/harmonic
            pair_coeff 1 1 1.0 {exponents}
            velocity all create 0.02 7 loop all
            fix motion all nve/asphere
            compute turn all erotate/asphere
            timestep {2.0 / steps}
            thermo {steps // 40}
            thermo_style custom step pe ke c_turn
            thermo_modify format float %.17g norm no
            run {steps}""",
            tmp_path,
        )
        rows = re.search(r"Step .*\n((?:\s*\d+(?: +\S+){3} *\n)+)", done)[1].splitlines()
        push, move, spin = np.array([row.split()[1:] for row in rows], float).T
        total = push + move + spin
        assert len(total) == 41
        assert push.max() > 1e-3 * total[0]  # they collide
        assert spin[-1] > 1e-2 * total[0]  # and turn
        return np.ptp(total) / total[0]

    coarse, fine = fluctuation(400), fluctuation(6400)
    measured(coarse=coarse, fine=fine)
    assert fine < 2e-5
    assert fine < coarse / 8
