"""Draw frames of a shear with particles coloured by how fast they turn.

    python analysis/shear/rotation.py runs/shear/a4_phi0.88_g1e-5.h5 --out rotation.png

-dtheta/dt over the rate: 1/2 for a disc that nothing hinders, blue where particles turn with the flow and red where they
turn against it. One panel for each file, of the frame `--frame`. As the pictures of Marschall & Teitel, Phys. Rev. E 100,
032906 (2019). The last line of standard output is one JSON object with the mean, the median and the spread.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.contacts import Contacts
from jamshape.drawing.colors import Coloring
from jamshape.drawing.packing import draw_packing
from jamshape.drawing.saving import save_figure
from jamshape.drawing.shear import title_of
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.flow.host import Host
from jamshape.measures.shears import ShearOf, read_shear

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.rotation import rotation_rates

# Colours end here, as rates over that of the shear.
END = 2.0


class Frame(NamedTuple):
    """A frame and how fast its particles turn, over the rate of the shear."""

    run: ShearOf
    contacts: Contacts
    rates: FloatArray


def frame_of(path: Path, frame: int) -> Frame:
    """Read a frame."""
    of, known = read_shear(path), read_attributes(path)
    packing = read_packing(path, frame)
    host = Host.shearing(of.ensemble.gdot, of.ensemble.flow)
    rates = rotation_rates(packing, host, k_d=float(known.get("k_d", 1.0)))
    return Frame(of, Contacts.of(packing), -rates / of.ensemble.gdot)


def main(options: Namespace) -> None:
    """Read, draw, report."""
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415 - not needed for --help and for errors
    from matplotlib.colors import Normalize  # noqa: PLC0415

    frames = [frame_of(path, options.frame) for path in options.files]
    figure = figure_of(5.2 * len(frames) + 0.8, 5.4, dpi=160)
    mapped = ScalarMappable(Normalize(-END, END), "RdBu")
    panels = figure.subplots(1, len(frames), squeeze=False)[0]
    for axes, one in zip(panels, frames, strict=True):
        rgb = np.asarray(mapped.to_rgba(one.rates))[:, :3]
        draw_packing(axes, one.contacts, Coloring(rgb, [], one.rates))
        axes.set_title(title_of(one.run), fontsize=8)
    bar = figure.colorbar(mapped, ax=list(panels), shrink=0.8, extend="both")
    bar.set_label(r"rotation $-\dot\theta/\dot\gamma$")
    save_figure(figure, options.out)
    rows = [
        one.run.ensemble.report()
        | {"mean": one.rates.mean(), "median": np.median(one.rates), "spread": one.rates.std()}
        for one in frames
    ]
    report({"out": options.out, "frames": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "rotation.png", "RUN.h5")
    parser.add_argument("--frame", type=int, default=-1, help="negative: from the end (-1)")
    run(parser, main)
