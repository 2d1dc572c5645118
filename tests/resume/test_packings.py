"""What the recorder promises of packings in the making, whose stages share one file beside the result."""

import time
from contextlib import suppress

import numpy as np
import pytest
from drivers import EVERY, NONE, SHORT
from killing import differences, ended, forked, said
from thinned import quick

import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.files.content import Content
from jamshape.files.h5md import read_attributes
from jamshape.protocols import make
from jamshape.protocols.recipe import Recipe
from jamshape.recording.recorder import How

pytestmark = pytest.mark.lammps

RODS = js.Spherocylinders(alpha=1)
LONG = js.Spherocylinders(alpha=4)
QUICK = {"phi_start": 0.55, "u0": 1e-6, "n": 16}

PACKINGS = {
    "quasistatic": (RODS, QUICK),
    "strict": (LONG, {"n": 16, "u0": 1e-10, "seed": 5, "strict": True}),
    "long rods": (LONG, {"n": 16, "u0": 1e-12, "seed": 34}),
    "equal steps": (RODS, QUICK | {"protocol": "steps", "delta_phi": 5e-3}),
    "Monte Carlo": (
        js.Superellipsoids(p=1.5),
        {"n": 12, "protocol": 2, "phi_start": 0.3, "phi_thermal": 0.4, "n_sweeps": 60, "delta_phi": 2e-2},
    ),
    "dynamics": (RODS, QUICK | {"protocol": "dynamics", "kappa": 1e-5, "p_end": 1e-3}),
    "marschall-2018": (
        RODS,
        QUICK | {"u0": 1.5e-6, "protocol": "marschall-2018", "kappa": 1e-4, "search": "bisection"},
    ),
}  # fmt: skip

MARKS = (*SHORT, ("jamshape.protocols.approach.ROWS_PER_MARK", 20))


def pack(name, file, **more):
    particles, settings = PACKINGS[name]
    return js.make_packing(particles, file=file, progress=False, **settings | more)


def names(folder):
    return {path.name for path in folder.iterdir()} - {"said.log"}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Packings that were made in one go, without a checkpoint."""
    made = {}

    def of(name):
        if name not in made:
            file = tmp_path_factory.mktemp("whole") / "packing.h5"
            assert (
                ended(forked(pack, (name, file), file.with_name("said.log"), (*MARKS, *NONE))) == 0
            )
            made[name] = file
        return made[name]

    return of


@pytest.mark.parametrize("name", quick(PACKINGS, {"strict", "Monte Carlo"}))
def test_checkpoints_do_not_change_a_packing(name, whole, tmp_path):
    file = tmp_path / "packing.h5"
    code = ended(forked(pack, (name, file), tmp_path / "said.log", (*MARKS, *EVERY)))
    assert code == 0, said(tmp_path)
    assert not differences(whole(name), file, without=())
    assert names(tmp_path) == names(whole(name).parent)


def put_down(name, file):
    """Make a packing in as many calls as it takes, each put down at its first mark but a few."""
    stops = 0
    while not file.exists():
        with suppress(TimeLimitError):
            pack(name, file, seconds=0.03 * (stops % 3))
        stops += 1
    assert stops > 2


@pytest.mark.parametrize("name", quick(PACKINGS, {"long rods", "equal steps"}))
def test_a_packing_put_down_again_and_again_ends_as_if_it_were_not(name, whole, tmp_path):
    file = tmp_path / "packing.h5"
    code = ended(forked(put_down, (name, file), tmp_path / "said.log", (*MARKS, *NONE)), 240)
    assert code == 0, said(tmp_path)
    assert not differences(whole(name), file, without=())
    assert names(tmp_path) == names(whole(name).parent)


def test_other_settings_are_refused_and_again_begins_anew(tmp_path):
    file = tmp_path / "packing.h5"
    with pytest.raises(TimeLimitError, match=r"stopped after .* the same command resumes"):
        pack("quasistatic", file, seconds=0.0)
    assert names(tmp_path) == {"packing.h5.making.h5"}
    before = Content.read(tmp_path / "packing.h5.making.h5").checkpoint
    assert before
    with pytest.raises(
        ValueError, match=r"holds a packing with u0=1e-06, expected 1e-07; .* again"
    ):
        pack("quasistatic", file, u0=1e-7)
    packing = pack("quasistatic", file, u0=1e-7, again=True)
    assert packing.u == pytest.approx(1e-7, rel=1e-6)
    assert names(tmp_path) == {"packing.h5"}


def test_the_time_of_a_compression_counts(tmp_path, monkeypatch):
    """Both files share the time that was given."""
    found = []
    monkeypatch.setattr(make, "compress", lambda *_: time.sleep(0.2))
    monkeypatch.setattr(make, "record", lambda _path, _plan, how: found.append(how.seconds))
    for seconds in (0.1, 1.0, None):
        make.make(Recipe(n=16), tmp_path / "packing.h5", How(seconds=seconds))
    assert found[0] == 0.0
    assert 0.5 < found[1] <= 0.8
    assert found[2] is None


def test_a_compression_serves_packings_at_other_energies(whole, tmp_path):
    file = tmp_path / "packing.h5"
    run = whole("dynamics").with_name("packing.h5.run.h5")
    beside = tmp_path / "packing.h5.run.h5"
    beside.write_bytes(run.read_bytes())
    pack("dynamics", file, u0=1e-7)
    assert beside.read_bytes() == run.read_bytes()
    assert read_attributes(file)["u"] == pytest.approx(1e-7, rel=1e-6)
    np.testing.assert_array_equal(js.load(beside).phi, js.load(run).phi)
