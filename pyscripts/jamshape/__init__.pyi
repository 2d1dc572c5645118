"""Jamming of soft, frictionless, athermal particles that are not round; see `jamshape.__init__`."""

from .checks import NotReachedWarning as NotReachedWarning
from .front.compressing import compress as compress
from .front.compressing import slow_compress as slow_compress
from .front.energies import Energy as Energy
from .front.energies import energy as energy
from .front.ensemble_file import EnsembleFile as EnsembleFile
from .front.ensembles import ensemble as ensemble
from .front.files import load as load
from .front.files import save as save
from .front.frames import frames as frames
from .front.laddering import ladder as ladder
from .front.making import make_packing as make_packing
from .front.minimising import minimise as minimise
from .front.modes import Modes as Modes
from .front.modes import modes as modes
from .front.movies import animate as animate
from .front.nonaffine import nonaffine as nonaffine
from .front.packing import Packing as Packing
from .front.pictures import plot as plot
from .front.recorded import resume as resume
from .front.run import CyclicShearFile as CyclicShearFile
from .front.run import LadderFile as LadderFile
from .front.run import QuasistaticShearFile as QuasistaticShearFile
from .front.run import RunFile as RunFile
from .front.run import ShearFile as ShearFile
from .front.shearing import cyclic_shear as cyclic_shear
from .front.shearing import quasistatic_shear as quasistatic_shear
from .front.shearing import shear as shear
from .lammps.session import Session as Session
from .measures.nonaffine import Nonaffine as Nonaffine
from .packing import Box as Box
from .shapes.clump import bumpy_discs as bumpy_discs
from .shapes.clump import dimer_discs as dimer_discs
from .shapes.clump import trimer_discs as trimer_discs
from .shapes.named import Clumps as Clumps
from .shapes.named import Dimers as Dimers
from .shapes.named import Spherocylinders as Spherocylinders
from .shapes.named import Spheropolygons as Spheropolygons
from .shapes.named import Superellipsoids as Superellipsoids
from .shapes.particles import Kind as Kind
from .shapes.particles import Particles as Particles
from .shapes.shape import Interaction as Interaction
from .shapes.spheropolygon import regular_polygon as regular_polygon

__version__: str
