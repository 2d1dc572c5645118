"""Packings in OVITO, with exact bodies coloured by kind.

Rods are spherocylinders there, with the body's z as axis: their orientation is ours after a quarter rotation that takes
z to x. Superellipsoids are superquadrics, other bodies meshes in units of their size. OVITO keeps orientations and
shapes in single precision; so the doubles are attached as properties whose names begin with "Jamshape", which
`from_ovito` reads.
"""

from __future__ import annotations

import itertools
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.drawing.colors import of_kinds
from jamshape.drawing.kinds import kinds_of
from jamshape.exchange.fields import PARTICLE_RESTS, alike, in_space, packing_of, particle_fields
from jamshape.exchange.tools import tool
from jamshape.files.frames import as_rest
from jamshape.files.hdf5 import FileFormatError
from jamshape.packing import Lengths, Packing, angle_from_quaternion
from jamshape.packing.rotation import product
from jamshape.shapes.shape import Interaction, stiffness_text, stiffness_told
from jamshape.shapes.solid import RoundedSegment, Solid, Superquadric

_PREFIX = "Jamshape "
_OWN = ("position", "id")  # held by OVITO in full precision

_ROUNDING = 4 * 2.0**-24  # relative, in single precision

_Z_TO_X = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)  # w i j k
_STILL = (1.0, 0.0, 0.0, 0.0)

_LEVEL = 4  # of meshes
_DIGITS = 9  # in which bodies with a common mesh agree


class _Glyph(NamedTuple):
    """Representation of a body in OVITO."""

    name: str
    """Name in `ParticlesVis.Shape`."""
    aspherical_shape: tuple[float, ...] = ()
    roundness: tuple[float, float] | None = None
    first_turned: tuple[float, float, float, float] = _STILL


@singledispatch
def _glyph(solid: Solid) -> _Glyph:
    """Choose the representation of a body: triangles unless OVITO has a glyph for it."""
    del solid
    return _Glyph("Mesh")


@_glyph.register
def _(solid: RoundedSegment) -> _Glyph:
    shape = (solid.radius, solid.radius, 2 * solid.half_length)
    return _Glyph(solid.GLYPH, shape, first_turned=_Z_TO_X)


@_glyph.register
def _(solid: Superquadric) -> _Glyph:
    return _Glyph(solid.GLYPH, tuple(solid.semi_axes.tolist()), solid.roundness)


def to_ovito(packing: Packing, rattlers: BoolArray | None = None) -> Any:
    """Convert a packing for OVITO.

    Parameters
    ----------
    packing : Packing
    rattlers : (N,) array of bool, optional
        Drawn in grey, such as from `find_rattlers`.

    Returns
    -------
    ovito.data.DataCollection
        To draw it, make it the source of a pipeline:
        ``Pipeline(source=StaticSource(data=to_ovito(packing)))``. Particle types are the kinds in our pictures,
        with their colours.

    Raises
    ------
    ImportError
        If OVITO is not installed.
    """
    data = tool("ovito.data", "ovito").DataCollection()
    vis = tool("ovito.vis", "ovito")
    _add_cell(data, packing)
    particles = data.create_particles(count=packing.n)
    particles.create_property("Position", data=in_space(packing.position))
    particles.create_property("Particle Identifier", data=packing.id)
    _add_bodies(particles, packing)
    _add_types(particles, packing, vis)
    _add_colors(particles, packing, np.zeros(packing.n, bool) if rattlers is None else rattlers)
    for name, values in particle_fields(packing, rests=packing.has_rests).items():
        if name not in _OWN:
            title = _PREFIX + name.replace("_", " ")
            particles.create_property(title, data=values)
    data.attributes["Timestep"], data.attributes["Time"] = packing.step, packing.time
    data.attributes[_PREFIX + "shape style"] = packing.shape_style
    for name, value in packing.law.stated().items():
        data.attributes[_PREFIX + name] = stiffness_text(value) if np.ndim(value) else value
    for field, titles in _rests_of_box(packing.dimension).items():
        for title, rest in zip(titles, getattr(packing, field).tolist(), strict=True):
            data.attributes[title] = rest
    return data


def from_ovito(data: Any) -> Packing:
    """Convert the data of `to_ovito` back to a packing, with positions, orientations and box as they are in OVITO now.

    Orientations changed there are in single precision.

    Parameters
    ----------
    data : ovito.data.DataCollection

    Raises
    ------
    FileFormatError
        If it lacks data of `to_ovito`, or is no longer a valid packing.
    """
    particles, cell = data.particles, data.cell
    try:
        D = 2 if cell.is2D else 3
        matrix = np.asarray(cell[...])
        lengths = Lengths.of(matrix[:D, :D])
        fields: dict[str, Any] = {
            "position": np.asarray(particles["Position"][...])[:, :D],
            "id": np.asarray(particles["Particle Identifier"][...]),
            "lo": matrix[:D, 3],
            "edges": lengths.edges,
            "tilt": lengths.tilt,
        }
        names = (
            "orientation",
            "diameters",
            "exponent",
            "form",
            "species",
            "image",
            *PARTICLE_RESTS,
        )
        for name in names:
            title = _PREFIX + name.replace("_", " ")
            if name not in (*PARTICLE_RESTS, "exponent", "form") or title in particles:
                fields[name] = np.asarray(particles[title][...])
        known = data.attributes
        for field, titles in _rests_of_box(D).items():
            fields[field] = np.array([float(known[title]) for title in titles])
        for name in ("position", "orientation", "edges", "tilt"):
            if f"{name}_rest" in fields:
                fields[f"{name}_rest"] = as_rest(fields[f"{name}_rest"], fields[name])
        law = {
            name: known[_PREFIX + name] for name in Interaction._fields if _PREFIX + name in known
        }
        if isinstance(law["k_e"], str):  # a table
            law["k_e"] = stiffness_told(law["k_e"])
        fields["law"] = Interaction.told(law)
        style = str(known[_PREFIX + "shape style"])
        packing = packing_of(fields, style, int(known["Timestep"]), float(known["Time"]))
        return _as_turned(packing, np.asarray(particles["Orientation"][...]))
    except (KeyError, AttributeError, TypeError) as error:
        msg = f"the data of OVITO lack {error}, expected data from to_ovito"
        raise FileFormatError(msg) from error


def _as_turned(packing: Packing, found: FloatArray) -> Packing:
    """Apply orientations x y z w that were changed in OVITO, where our doubles are outdated."""
    glyphs, _ = _glyphs(packing)
    before = product(packing.quaternions, glyphs[0].first_turned)
    now = np.asarray(found, np.float64)[:, [3, 0, 1, 2]]
    sign = np.where((now * before).sum(axis=1, keepdims=True) < 0, -1, 1)
    turned = (np.abs(now - sign * before) > _ROUNDING).any(axis=1)
    if not turned.any():
        return packing
    w, *vector = glyphs[0].first_turned
    quaternion = product(now, (w, *(-x for x in vector)))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    if packing.dimension == 2:
        orientation = np.where(turned, angle_from_quaternion(quaternion), packing.orientation)
    else:
        orientation = np.where(turned[:, None], quaternion, packing.orientation)
    rest = packing.orientation_rest * (orientation == packing.orientation)
    return packing.with_(orientation=orientation, orientation_rest=rest)


def _rests_of_box(dimension: int) -> dict[str, list[str]]:
    """Name the attributes for the low parts of the box, by the field of a packing."""
    axes = "xyz"[:dimension]
    tilts = ["".join(two) for two in itertools.combinations(axes, 2)]
    return {
        "edges_rest": [f"{_PREFIX}edges rest {axis}" for axis in axes],
        "tilt_rest": [f"{_PREFIX}tilt rest {tilt}" for tilt in tilts],
    }


def _add_cell(data: Any, packing: Packing) -> None:
    """Add the box; planar ones extend around z = 0 to their drawn height."""
    D = packing.dimension
    matrix = np.zeros((3, 4))
    matrix[2, 2:] = 1.0, -0.5
    matrix[:D, :D] = packing.box.matrix
    matrix[:D, 3] = packing.box.lo
    cell = data.create_cell(matrix, pbc=(True, True, D == 3))
    cell.is2D = D == 2


def _glyphs(packing: Packing) -> tuple[list[_Glyph], IntArray]:
    """Return the glyph of each body, and the index of the body of each particle."""
    bodies = alike(packing)
    rows = zip(packing.diameters[bodies.first], packing.form[bodies.first], strict=True)
    return [_glyph(packing.shape.solid(d, form)) for d, form in rows], bodies.of


def _add_bodies(particles: Any, packing: Packing) -> None:
    """Add sizes and orientations."""
    glyphs, of = _glyphs(packing)
    quaternions = product(packing.quaternions, glyphs[0].first_turned)
    particles.create_property("Orientation", data=quaternions[:, [1, 2, 3, 0]])
    if not glyphs[0].aspherical_shape:
        particles.create_property("Radius", data=_known_sizes(packing).size)
        return
    shapes = np.array([glyph.aspherical_shape for glyph in glyphs])
    particles.create_property("Aspherical Shape", data=shapes[of])
    if glyphs[0].roundness is not None:
        roundness = np.array([glyph.roundness for glyph in glyphs])[of]
        particles.create_property("Superquadric Roundness", data=roundness)


class _Known(NamedTuple):
    """Parameters and sizes of the particles of a shape."""

    parameters: FloatArray
    """(N, P), rounded to the digits in which bodies with a common mesh agree."""
    size: FloatArray
    """(N,), [length], unit in which particles of equal parameters are one body."""


def _known_sizes(packing: Packing) -> _Known:
    bodies = alike(packing)
    rows = zip(packing.diameters[bodies.first], packing.form[bodies.first], strict=True)
    found = [packing.shape.parameters_of(d, form) for d, form in rows]
    names = [parameter.name for parameter in packing.shape.parameters]
    # Those that others replace are 0.
    parameters = np.array([[of.get(name, 0.0) for name in names] for of, _ in found])
    sizes = np.array([size for _, size in found])
    return _Known(np.round(parameters, _DIGITS)[bodies.of], sizes[bodies.of])


def _add_types(particles: Any, packing: Packing, vis: Any) -> None:
    """Add a type for each kind, or for each species if there are too many kinds, and each mesh."""
    known = _known_sizes(packing)
    kinds = kinds_of(packing)
    key = np.column_stack([kinds.of if kinds.labels else packing.species, known.parameters])
    _, first, types = np.unique(key, axis=0, return_index=True, return_inverse=True)
    types = types.ravel()
    listed = particles.create_property("Particle Type", data=types + 1)
    colors = of_kinds(packing, np.zeros(packing.n, bool)).rgb
    glyph = _glyph(packing.shape.solid(packing.diameters[0], packing.form[0]))
    for k, i in enumerate(first.tolist()):
        own = listed.add_type_id(k + 1, particles)
        sizes = known.size[types == k]
        span = "..".join(dict.fromkeys(f"{x:.3g}" for x in (sizes.min(), sizes.max())))
        words = [
            f"{p.name} {x:.3g}"
            for p, x in zip(packing.shape.parameters, known.parameters[i], strict=True)
        ]
        own.name = ", ".join([*words, f"{packing.shape.unit} {span}"])
        own.color = tuple(colors[i])
        own.shape = getattr(vis.ParticlesVis.Shape, glyph.name)
        if not glyph.aspherical_shape:
            own.mesh, own.radius = _mesh(packing, i, known.size[i]), 1.0


def _mesh(packing: Packing, i: int, size: float) -> Any:
    """Make the mesh of a particle in units of its size."""
    surface = packing.shape.surface(packing.diameters[i], packing.form[i], _LEVEL)
    mesh = tool("ovito.data", "ovito").TriangleMesh()
    mesh.set_vertices(surface.vertices / size)
    mesh.set_faces(surface.triangles)
    return mesh


def _add_colors(particles: Any, packing: Packing, rattlers: BoolArray) -> None:
    """Add colours of particles where types do not determine them."""
    if rattlers.any() or not kinds_of(packing).labels:
        particles.create_property("Color", data=of_kinds(packing, rattlers).rgb)
