"""Commands and figures with input that is none: one sentence, no zero exit, nothing written, nothing replaced."""

from __future__ import annotations

import re
import runpy
import shlex
import sys
from pathlib import Path

import pytest

from jamshape import commands

ANALYSIS = Path(__file__).parents[2] / "analysis"

# Of no meaning for any number that is not counted in shares or angles.
NO_NUMBERS = ("-1", "nan", "1e300", "x")
NO_COUNTS = ("-1", "0", "1.5", "99999999999")

COMPRESS = "compress --n 8 --kappa 1e-2 --phi-start 0.3 --phi-end 0.32 --out new.h5"
RUN = "compress --alpha 1 --n 8 --kappa 1e-2 --dt 0.1 --phi-start 0.3 --phi-end 0.32 --rows 4 --frames 2 --out run.h5"
PACK = "pack --n 8 --out new.h5"
DYNAMICS = "pack --protocol dynamics --n 8 --out new.h5"
STEPS = "pack --protocol steps --n 8 --out new.h5"
PUBLISHED = "pack --n 8 --protocol marschall-2018 --out new.h5"
SLOW = "slow --n 8 --phi-end 0.85 --out new.h5"
INITIAL = "initial --n 8 --phi 0.2 --out new.data"


def each(start, options, values):
    return [
        (f"{start} {option} {value}", option.strip("-")) for option in options for value in values
    ]


# Files that no search can start from.
STARTS = {
    "none.h5": "none.h5",
    "text.h5": "text.h5",
    "cut.h5": "cut.h5",
    "other.h5": "other.h5",
    "empty.h5": "empty.h5",
    "'a folder'": "a folder",
    "run.h5": "its last frame, at phi = 0.320.*, has u = .* expected more than u0 = 1e-15; compress further",
}

CASES = [
    *each(COMPRESS, ["--kappa", "--phi-start", "--phi-end", "--dt", "--integration-tolerance", "--alpha", "--size-ratio"],
          [*NO_NUMBERS, "inf"]),
    *each(COMPRESS, ["--n", "--rows", "--frames"], NO_COUNTS),
    *each(COMPRESS, ["--kappa", "--dt"], ["0", "1e-300", "1e3"]),
    *each(COMPRESS, ["--sides", "--dimension"], ["0", "4", "x"]),
    *each(COMPRESS, ["--seed"], ["-1", "1.5", "99999999999999999999"]),
    *each(COMPRESS, ["--alpha"], ["1e5", "1e-9"]),
    *each(COMPRESS, ["--size-ratio"], ["0.5", "11"]),
    *each(f"{COMPRESS} --shape superellipsoid --dimension 3", ["--p", "--w1", "--w2"],
          ["0", "-1", "nan", "1e4"]),
    *each(f"{COMPRESS} --shape superellipsoid", ["--w1"], ["1.1"]),
    *each(f"{COMPRESS} --shape superellipsoid", ["--w2"], ["0.9"]),
    *each(f"{COMPRESS} --shape superellipsoid", ["--p"], ["0.5"]),
    (f"{COMPRESS} --shape dimer --alpha 0", "alpha is 0"),
    (f"{COMPRESS} --shape cube", "invalid choice"),
    (f"{COMPRESS} --p 2", "--p does not apply"),
    (f"{COMPRESS} --kind alpha", "a kind is 'alpha'"),
    (f"{COMPRESS} --kind beta=1", "beta is not a parameter"),
    (f"{COMPRESS} --kind alpha=4,shar=0.5", "shar is not a parameter of spherocylinders, expected one of alpha, size, share, spread"),
    (f"{COMPRESS} --shape superellipsoid --p 1 --n1 20 --n2 2", "p is given beside n1 and n2, which replace it, expected one or the other; leave p out"),
    (f"{COMPRESS} --kind alpha=1,size=-1", "size is -1"),
    (f"{COMPRESS} --kind alpha=1,size=nan", "size is nan"),
    (f"{COMPRESS} --kind alpha=1,share=0", "share is 0"),
    (f"{COMPRESS} --kind alpha=1,spread=7", "spread is 7"),
    (f"{COMPRESS} --kind size=1 --kind size=20", "largest size over the smallest"),
    (f"{COMPRESS} --kind alpha=1 --alpha 4", "--kind excludes"),
    (f"{COMPRESS} --integrator euler", "integrator is 'euler'"),
    (f"{COMPRESS} --integrator 'heun\nshell touch X'", r"integrator is 'heun\\nshell touch X'"),
    (f"{COMPRESS} --phi-end 0.3", "an end above the start"),
    (f"{COMPRESS} --phi-start 0.9 --phi-end 1", "stalled at phi"),
    (f"{COMPRESS} --dt 1e-6 --kappa 1e-14", "more than 1e.12 steps"),
    (f"{COMPRESS} --kapa 1", "unrecognized arguments"),
    ("compress --n 8", "required: --out"),
    (f"{COMPRESS} --integrator rkc2 --dt 0.1", "--dt 0.1 has no effect with --integrator rkc2"),
    (f"{COMPRESS} --dt 0.1 --integration-tolerance 1e-4", "--integration-tolerance 0.0001 has no effect with --integrator heun"),
    *each(COMPRESS, ["--seconds"], NO_NUMBERS),
    *each(PACK, ["--seconds"], NO_NUMBERS),
    ("compress --resume --out typo.h5", "typo.h5"),
    *((f"{RUN} {option} {other}", f"run.h5 holds a compression with {option} {own}, expected {other}; choose another --out, or use --again")
      for option, own, other in (("--kappa", "0.01", "1e-05"), ("--n", "8", "9"), ("--phi-end", "0.32", "0.9"),
                                 ("--phi-start", "0.3", "0.31"), ("--dimension", "2", "3"), ("--alpha", "1.0", "4.0"),
                                 ("--rows", "4", "5"), ("--dt", "0.1", "0.05"))),
    *((f"compress --n 8 --out {name}", words) for name, words in (
        ("start.h5", "does not hold a compression, expected one; choose another --out, or use --again"),
        ("text.h5", "text.h5: is not an HDF5 file"), ("start.data", "start.data"), ("'a folder'", "a folder"))),
    ("compress --n 8 --out 'a\nb.h5'", "control character"),
    ("compress --n 8 --out text.h5/new.h5", "text.h5"),
    *((f"compress --resume --out {name}", words) for name, words in (
        ("start.h5", "holds no run"), ("other.h5", "expected"), ("empty.h5", "expected"),
        ("text.h5", "expected"), ("cut.h5", "expected"), ("start.data", "expected"),
        ("'a folder'", "folder"),
        ("newline.h5", "integrator is"), ("euler.h5", "integrator is"), ("backwards.h5", "kappa is nan"),
        ("sides.h5", "sides is 7"), ("no_rows.h5", "rows is 0"), ("no_frames.h5", "frames is -3"),
        ("words.h5", "dt is"), ("stiff.h5", "k_e is"))),
    *each(PACK, ["--u0", "--accuracy", "--tolerance", "--phi-start", "--delta-phi", "--alpha"],
          [*NO_NUMBERS, "inf"]),
    *each(DYNAMICS, ["--kappa", "--p-end", "--u0"], [*NO_NUMBERS, "inf"]),
    *each(PACK, ["--n"], NO_COUNTS),
    *each(PACK, ["--seed", "--dimension"], ["-1", "x"]),
    *each(STEPS, ["--delta-phi", "--phi-start", "--u0"], NO_NUMBERS),
    *each(f"{STEPS} --protocol 2", ["--phi-thermal"], NO_NUMBERS),
    *each(f"{STEPS} --protocol 2", ["--n-sweeps"], ["-1", "1.5", "99999999999"]),
    (f"{STEPS} --protocol 3", "invalid choice"),
    (f"{STEPS} --protocol yuan", "invalid choice"),
    (f"{STEPS} --protocol 1 --n-sweeps 5", "does not apply to the protocol yuan-2019-1"),
    (f"{STEPS} --start run.h5", "does not apply to the protocol"),
    (f"{DYNAMICS} --kappa 1e-14", "use jamshape slow, whose steps are implicit"),
    *each(PUBLISHED, ["--kappa", "--phi-start", "--phi-end", "--u0", "--tolerance"], NO_NUMBERS),
    (f"{PUBLISHED} --kappa 1e-12", "at least 1e-10"),
    (f"{PUBLISHED} --phi-end 0.3", "expected an end above the start"),
    (f"{PUBLISHED} --p-end 1e-3", "does not apply to the protocol marschall-2018"),
    (f"{PUBLISHED} --u0 0", "--u0 0 does not work with the protocol marschall-2018"),
    (f"{PUBLISHED} --search blind", "invalid choice"),
    (f"{PUBLISHED} --search bisection --minimiser none", "invalid choice"),
    (f"{PUBLISHED} --minimiser cg_marschall", "--minimiser cg_marschall has no effect with the search extrapolation"),
    *((f"{PUBLISHED} --start {name}", sentence) for name, sentence in STARTS.items()),
    (f"{PUBLISHED} --start run.h5 --n 9", "--n 9 differs from 8 of --start run.h5; leave it out"),
    (f"{PUBLISHED} --start run.h5 --alpha 3", "requested, Particles\\('spherocylinder', alpha=3"),
    (f"{PUBLISHED} --start run.h5 --shape dimer", "requested, Particles\\('dimer'"),
    (f"{PUBLISHED} --start run.h5 --kappa 1e-6", "--kappa 1e-06 has no effect on a start that is already compressed"),
    ("sweep --alpha 1 --protocol marschall-2018 --start run.h5 --out new", "--start is run.h5, which has no effect"),
    (f"{STEPS} --protocol 2 --phi-thermal 0.2", "a start at a smaller packing fraction"),
    (f"{STEPS} --kappa 1e-6", "does not apply to the protocol"),
    (f"{PACK} --kappa 1e-6", "--kappa does not apply to the protocol quasistatic, expected another protocol or setting"),
    (f"{STEPS} --accuracy 1e-6", "--accuracy 1e-06 has no effect without --u0, expected both or neither"),
    (f"{DYNAMICS} --delta-phi 1e-3", "does not apply to the protocol"),
    (f"{PACK} --protocol walking", "invalid choice"),
    (f"{DYNAMICS} --u0 0", "--u0 0 does not work with the protocol dynamics"),
    *((f"{way} --u0 0.01", "take another u0") for way in (PACK, DYNAMICS, STEPS)),
    (f"{DYNAMICS} --kappa 1e-2", "at most kappa_start"),
    *((f"pack --n 8 --out {name}", "expected") for name in ("start.h5", "run.h5", "text.h5", "empty.h5")),
    ("pack --n 8 --out 'a folder'", "folder"),
    ("pack --protocol steps --n 8 --out 'a\nb.h5'", "control character"),
    *each(SLOW, ["--kappa", "--phi-start", "--phi-end", "--integration-tolerance", "--largest-drop", "--p-end", "--alpha"],
          NO_NUMBERS),
    *each(f"{SLOW} --phi-slow 0.82", ["--kappa-before"], ["0", *NO_NUMBERS]),
    *each(SLOW, ["--n"], NO_COUNTS),
    *each(SLOW, ["--phi-slow"], ["nan", "-1", "x"]),
    (f"{SLOW} --phi-end 0.5", "an end above the start"),
    (f"{SLOW} --phi-start 1", "phi-start is 1"),
    (f"{SLOW} --method euler", "invalid choice"),
    ("slow --start none.h5 --out new.h5", "none.h5"),
    ("slow --start text.h5 --out new.h5", "text.h5"),
    ("slow --start start.h5 --n 8 --out new.h5", "--n 8 has no effect with --start start.h5, expected one of them"),
    ("slow --start start.h5 --seed 2 --out new.h5", "--seed 2 has no effect with --start start.h5"),
    ("slow --start start.h5 --alpha 1 --out new.h5", "has no effect with --start start.h5"),
    ("slow --start start.h5 --phi-start 0.7 --out new.h5", "--phi-start 0.7 has no effect with --start start.h5"),
    ("slow --start dense.h5 --p-end 1e-9 --phi-end 1.5 --out new.h5",
     "--p-end 1e-09 is not above the pressure of the start, 0.*, expected a larger one"),
    (f"{SLOW} --kappa-before 1e-6", "--kappa-before 1e-06 has no effect without --phi-slow, expected both or neither"),
    (f"{SLOW} --phi-slow 0.9", "--phi-slow 0.9 is not below --phi-end, .* expected a smaller one"),
    *((f"{command} --start start.h5 {option} --out new.h5", f"{option} has no effect with --start start.h5")
      for command in ("shear", "cycle", "aqs") for option in ("--phi 0.7", "--n 8", "--seed 1")),
    ("shear --start start.h5 --alpha 4 --out new.h5", "has no effect with --start start.h5"),
    *each("cycle --n 8 --out new.h5", ["--amplitude", "--period", "--dt", "--integration-tolerance"], NO_NUMBERS),
    *each("cycle --n 8 --out new.h5", ["--cycles", "--rows", "--frames"], NO_COUNTS),
    ("cycle --n 8 --rows 10 --out new.h5", "--rows 10 samples in a cycle miss the largest strain, expected a multiple of 4"),
    ("cycle --n 8 --amplitude 1 --period 1 --out new.h5", "--amplitude 1.0 and --period 1.0 make a rate of 4, expected a rate"),
    ("shear --n 8 --integrator rkc2 --dt 0.1 --out new.h5", "--dt 0.1 has no effect with --integrator rkc2"),
    ("shear --n 8 --dt 0.1 --integration-tolerance 1e-4 --out new.h5", "--integration-tolerance 0.0001 has no effect with --integrator heun"),
    ("shear --n 8 --gdot 1e-8 --frames 3 --out new.h5", "--frames 3 has no effect with --integrator tr-bdf2"),
    ("slow --start start.h5 --phi-end 0.2 --out new.h5", "expected less than phi_end"),
    *((f"slow --n 8 --out {name}", "expected") for name in ("start.h5", "text.h5", "empty.h5")),
    *each(INITIAL, ["--phi", "--alpha"], [*NO_NUMBERS, "inf"]),
    *each(INITIAL, ["--n"], NO_COUNTS),
    *each(INITIAL, ["--seed"], ["-1", "x"]),
    ("initial --n 8 --out new.txt", "a suffix .data or .h5"),
    ("initial --n 8 --out start.h5", "--again"),
    ("initial --n 8 --out none/new.data", "none"),
    ("modes start.h5 --out start.h5", "would be replaced"),
    ("modes start.h5 --out run.h5", "holds no modes"),
    ("modes start.h5 --out text.h5", "expected"),
    ("modes start.h5 --out new.h5", "expected"),
    ("modes start.h5 --out new.h5 --plot start.h5", "would be replaced"),
    ("modes none.h5 --out new.h5", "none.h5"),
    ("modes text.h5 --out new.h5", "text.h5"),
    ("modes start.h5 --out new.h5 --method exact", "invalid choice"),
    ("modes start.h5 --out new.h5 --method refined --lowest 4", "--method refined has no effect with --lowest 4"),
    ("modes start.h5 --out new.h5 --method plain --near 0.1", "--method plain has no effect with --near 0.1"),
    ("modes start.h5 --out new.h5 --rotation turns", "invalid choice"),
    *each("modes start.h5 --force --out new.h5", ["--lowest"], ["0", "-1", "x", "99999999999"]),
    *each("modes start.h5 --force --out new.h5", ["--near", "--least-force"], ["nan", "-1", "x", "inf"]),
    ("draw start.h5 --out start.h5", "would be replaced"),
    ("draw start.h5 --out none/new.png", "none"),
    *((f"draw {name} --out new.png", name) for name in ("none.h5", "text.h5", "other.h5", "empty.h5", "cut.dump")),
    *each("draw start.h5 --out new.png", ["--dpi"], ["0", "-1", "x", "100000"]),
    *each("draw start.h5 --out new.png", ["--height", "--turn"], ["nan", "inf", "x"]),
    *each("draw start.h5 --out new.png", ["--level", "--sides", "--color"], ["9", "none"]),
    ("draw start.h5 --out new.png --frame 7", "frame"),
    *((f"draw start.h5 --out new.png {option}", f"{option} has no effect in the plane, expected a packing in space")
      for option in ("--height 30.0", "--turn 10.0", "--level 2")),
    ("draw start.h5 --out new.png --color cubatic", "cubatic"),
    ("export start.h5 --out start.h5", "would be replaced"),
    ("export start.h5 --out run.h5", "--again"),
    ("export start.h5 --out new.png", "jamshape draw"),
    ("export start.h5 --out new.data --to cif", "invalid choice"),
    ("export run.h5 --out new.data --frame 99", "frame"),
    *((f"export {name} --out new.data", name) for name in ("none.h5", "text.h5", "other.h5", "empty.h5", "text.data")),
    *((f"info {name}", name) for name in ("none.h5", "text.h5", "empty.h5", "cut.h5", "other.h5")),
    ("info 'a folder'", "folder"),
    ("sweep --out new --samples 1", "no particles were given"),
    ("sweep --out new --alpha x", "invalid float"),
    ("sweep --out new --shape dimer --spherocylinder 1", "--shape dimer has no effect without --alpha or --kind"),
    ("sweep --out new --alpha 1 --kapa 1", "unrecognized arguments"),
    ("sweep --out new --alpha 1 --seconds -1", "--seconds is -1.0, expected a time from 0 to 1e+09"),
    ("sweep --out new --superellipsoid 1", "expected 3"),
    ("sweep --out start.h5 --alpha 1 --samples 1", "start.h5 is a file, expected a folder"),
    ("sweep --out new --alpha 1 --samples 1 --plot new.foo", "new.foo ends in '.foo', expected the name of a picture"),
    *((f"{command} --out new.{end}", f"new.{end} ends in '.{end}', expected the name of an HDF5 file, such as new.h5")
      for command, end in (("pack --n 8", "data"), ("pack --n 8", "dump"), ("pack --n 8", "xyz"), ("minimise start.h5", "GSD"),
                           ("compress --n 8", "txt"), ("slow --n 8", "png"), ("modes dense.h5", "data"))),
    *((f"{command} --out 'a folder'", "a folder is a folder, expected the name of a file to write")
      for command in ("pack --n 8", "compress --n 8", "export start.h5", "modes dense.h5")),
    ("draw 'a folder' --out new.png", "a folder is a folder, expected a file"),
    ("draw start.h5 --out new.foo", "new.foo ends in '.foo', expected the name of a picture"),
    ("modes dense.h5 --out new.h5 --plot new.foo", "new.foo ends in '.foo', expected the name of a picture"),
    ("pack --n 8 --u0 -1e-6 --out new.h5", "u0 is -1e-06, expected 0 or an energy density"),
    ("aqs --n 8 --step -1E-3 --out new.h5", "strain_step is -0.001, expected a step"),
    ("sing", "there is no command"),
    ("", "usage"),
]  # fmt: skip


def refusal_of(end):
    """Exit code and what was said with it."""
    said = end.value.code
    return (1, said) if isinstance(said, str) else (said, "")


BAR = re.compile(r"(\b0row|\| 0/\d+) \[")


def require_sentence(code, said, words):
    # A bar that has not begun to move says nothing.
    lines = [line for line in said.splitlines() if line.strip() and not BAR.search(line)]
    sentence = lines[-1]
    assert code not in {0, None}, said
    assert "Traceback" not in said
    assert code == 2 or len(lines) == 1, said  # argparse shows the usage before it
    told = sentence.replace("_", "-").lower()
    assert re.search(words, sentence) or words.replace("_", "-").lower() in told, sentence
    assert len(sentence) < 400


@pytest.mark.lammps
@pytest.mark.usefixtures("place")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("arguments", "words"), CASES, ids=[case[0] for case in CASES])
def test_a_command_refuses(arguments, words, capfd):
    with pytest.raises(SystemExit) as end:
        commands.main(shlex.split(arguments))
    code, text = refusal_of(end)
    lines = (capfd.readouterr().err + text).splitlines(keepends=True)
    said = "".join(line for line in lines if "without --resume, which goes" not in line)
    if words == "usage":
        assert code == 2
        assert words in said
    else:
        require_sentence(code, said, words)


# All that read files and draw; what else they take is checked as of commands.
FIGURES = sorted((ANALYSIS / "marschall_2018").glob("fig*.py"))
FIGURES += sorted((ANALYSIS / "yuan_2019").glob("fig*.py"))
NOT_OF_FILES = {"fig02_shapes"}


OPTIONS = [
    ("energy_ladder.py start.h5 --u0 -1 --out new", "u0 is -1"),
    ("energy_ladder.py start.h5 --u0 1e-9 --accuracy 0 --out new", "accuracy is 0"),
    ("energy_ladder.py none.h5 --u0 1e-9 --out new", "none.h5"),
    ("marschall_2018/fig07_snapshots.py start.h5 --dpi 0 --out new.png", "dpi is 0"),
    ("marschall_2018/fig08_contact_number.py start.h5 --largest nan --out new.png", "largest is nan"),
    ("marschall_2018/fig12_modes.py start.h5 --mode -1000 --out new.png", "expected"),
    ("marschall_2018/singular_limit.py --n 0 --out new", "n is 0"),
    ("marschall_2018/singular_limit.py --samples 0 --out new", "samples is 0"),
    ("marschall_2018/singular_limit.py --alpha -1 --out new", "alpha is -1"),
    ("marschall_2018/singular_limit.py --kappa 0 --out new", "kappa is 0"),
    ("yuan_2019/fig02_shapes.py --shape 1 2 3 --out new.png", "w1 = 2.0"),
    ("yuan_2019/fig02_shapes.py --dpi 0 --out new.png", "dpi is 0"),
    ("yuan_2019/fig09b_quartic_modes.py start.h5 --follow -1 --out new.png", "follow is -1"),
    ("yuan_2019/fig10_quartic_energy.py start.h5 --modes 0 --out new.png", "modes is 0"),
    ("errors/contact_error.py --pairs 0 --out new", "pairs is 0"),
    ("errors/contact_error.py --seed -1 --out new", "seed is -1"),
    ("errors/heun_error.py --n 0 --out new", "n is 0"),
    ("errors/integrator_error.py --kappa -1 --out new", "kappa is -1"),
    ("errors/integrator_error.py --n 0 --out new", "n is 0"),
    ("errors/minimiser_error.py --seconds nan --out new", "seconds is nan"),
    ("errors/stiff_error.py --kappas 0 --out new", "kappa is 0"),
    ("errors/spectrum_error.py none.h5 --out new.png", "none.h5"),
]  # fmt: skip


def run_script(words, monkeypatch):
    path = Path(words[0])
    monkeypatch.setattr(sys, "argv", words)
    monkeypatch.setattr(sys, "path", [str(path.parent), *sys.path])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(path), run_name="__main__")
    return refusal_of(end)


@pytest.mark.usefixtures("place")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("arguments", "words"), OPTIONS, ids=[case[0] for case in OPTIONS])
def test_a_script_refuses(arguments, words, capfd, monkeypatch):
    script, *options = shlex.split(arguments)
    code, text = run_script([str(ANALYSIS / script), *options], monkeypatch)
    require_sentence(code, capfd.readouterr().err + text, words)


@pytest.mark.usefixtures("place")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["none.h5", "text.h5", "other.h5", "'a folder'"])
@pytest.mark.parametrize("path", FIGURES, ids=lambda path: path.stem)
def test_a_figure_refuses(path, name, capfd, monkeypatch):
    if path.stem in NOT_OF_FILES:
        name = f"--shape {name}"
    words = [str(path), *shlex.split(f"{name} --out new.png")]
    code, text = run_script(words, monkeypatch)
    require_sentence(code, capfd.readouterr().err + text, "expected|No such|no |not |invalid")
