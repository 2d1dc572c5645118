"""Pictures of bodies in space: parallel projection, light, and hidden surfaces."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.drawing.saving import save_figure
from jamshape.files.disk import replacing
from jamshape.packing import Packing
from jamshape.shapes.mesh import SurfaceMesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AMBIENT, DIFFUSE, SHINE, GLOSS = 0.42, 0.62, 0.4, 28
RIM = 0.35  # cosine to the view below which a surface darkens, to show outlines
FINER = 2  # factor of oversampling before averaging


class View(NamedTuple):
    """Unit vectors to the viewer, to its right and up."""

    eye: FloatArray
    right: FloatArray
    up: FloatArray

    def flat(self, points: FloatArray) -> FloatArray:
        """Project (..., 3) points to (..., 2) in parallel projection."""
        return np.asarray(points @ np.array([self.right, self.up]).T)


class Faces(NamedTuple):
    """Triangles in space with the bodies that they belong to."""

    corners: FloatArray
    """(T, 3, 3) triangle, corner, coordinate."""
    normals: FloatArray
    """(T, 3) outward."""
    body: IntArray
    """(T,)"""


def view(height: float, turn: float) -> View:
    """Return the view from an elevation above the x-y plane and an azimuth about z, in degrees."""
    a, b = np.radians([height, turn])
    eye = np.array([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)])
    right = np.array([-np.sin(b), np.cos(b), 0])
    return View(eye, right, np.cross(eye, right))


def lit(color: FloatArray, normals: FloatArray, seen_from: View) -> FloatArray:
    """Colour (T, 3) faces with these normals under a light at the left above the viewer (Blinn 1977).

    `color` is (3,), or (T, 3) with one for each face.
    """
    eye, right, up = seen_from
    light = eye + 0.9 * up - 0.8 * right
    light /= np.linalg.norm(light)
    half = (light + eye) / np.linalg.norm(light + eye)
    diffuse = np.clip(normals @ light, 0, None)
    shine = np.clip(normals @ half, 0, None) ** GLOSS
    shaded = (AMBIENT + DIFFUSE * diffuse)[:, None] * color + SHINE * shine[:, None]
    return np.asarray(np.clip(shaded, 0, 1))


def mean_normals(mesh: SurfaceMesh) -> FloatArray:
    """(T, 3) unit normals of triangles, from those at their vertices."""
    normals = mesh.normals[mesh.triangles].mean(axis=1)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def faces_of(
    packing: Packing, level: int, seen_from: View, centers: FloatArray | None = None
) -> Faces:
    """Cover particles with triangles and keep those that face the viewer.

    Particles are drawn at (N, 3) centres, by default those in the box; equal shapes share one mesh.
    """
    if centers is None:
        centers = packing.box.lo + packing.box.wrapped(packing.position)[0]
    turned = np.stack([packing.body_axes(k) for k in range(3)], axis=1)
    kinds = np.column_stack([packing.diameters, packing.form])
    found = []
    for kind in np.unique(kinds, axis=0):
        mesh = packing.shape.surface(kind[:3], kind[3:], level)
        normals = mean_normals(mesh)
        for body in np.flatnonzero((kinds == kind).all(axis=1)):
            out = normals @ turned[body]
            seen = out @ seen_from.eye > 0
            corners = centers[body] + mesh.vertices[mesh.triangles[seen]] @ turned[body]
            found.append(Faces(corners, out[seen], np.full(len(corners), body)))
    return Faces(*(np.concatenate(part) for part in zip(*found, strict=True)))


def painted(faces: Faces, colors: FloatArray, seen_from: View) -> tuple[FloatArray, FloatArray]:
    """Sort faces from the farthest to the nearest, and light them.

    Small faces resolve the depth of bodies that hardly overlap.

    Parameters
    ----------
    faces : Faces
    colors : (N, 3) array of float64
        Colours of the bodies.
    seen_from : View

    Returns
    -------
    (T, 3, 2) polygons and (T, 3) their colours
    """
    order = np.argsort(faces.corners.mean(axis=1) @ seen_from.eye)
    normals = faces.normals[order]
    shade = lit(colors[faces.body[order]], normals, seen_from)
    rim = np.clip(normals @ seen_from.eye / RIM, 0, 1)
    shade *= (0.25 + 0.75 * rim * (2 - rim))[:, None]
    return seen_from.flat(faces.corners[order]), shade


def box_edges(packing: Packing, seen_from: View) -> tuple[FloatArray, FloatArray]:
    """Project the edges of the box: (3, 2, 2) those that end in the farthest corner, (9, 2, 2) others."""
    box = packing.box
    corner = np.array(list(np.ndindex(2, 2, 2)))
    place = box.lo + box.vectors(corner)
    farthest = int(np.argmin(place @ seen_from.eye))
    hidden: list[FloatArray] = []
    seen: list[FloatArray] = []
    for i in range(8):
        for j in range(i):
            if np.abs(corner[i] - corner[j]).sum() == 1:
                (hidden if farthest in {i, j} else seen).append(place[[i, j]])
    return seen_from.flat(np.array(hidden)), seen_from.flat(np.array(seen))


def draw_bodies(axes: Axes, packing: Packing, colors: FloatArray, seen: tuple[View, int]) -> None:
    """Draw particles in their box, on axes of equal scale without ticks.

    Parameters
    ----------
    axes : Axes
    packing : Packing
        In three dimensions.
    colors : (N, 3) array of float64
    seen : View and int
        View, and the level of the meshes (`faces_of`).
    """
    from matplotlib.collections import LineCollection, PolyCollection  # noqa: PLC0415

    seen_from, level = seen
    polygons, shades = painted(faces_of(packing, level, seen_from), colors, seen_from)
    back, front = box_edges(packing, seen_from)
    axes.add_collection(LineCollection(list(back), colors="0.45", lw=0.8, zorder=1))
    # With antialiasing, neighbours would leave a line between them.
    shown = PolyCollection(list(polygons), facecolors=shades, lw=0, antialiaseds=False, zorder=2)
    axes.add_collection(shown)
    axes.add_collection(LineCollection(list(front), colors="0.15", lw=0.9, zorder=3))
    every = np.concatenate([polygons.reshape(-1, 2), front.reshape(-1, 2)])
    low, high = every.min(axis=0), every.max(axis=0)
    pad = 0.01 * (high - low).max()
    axes.set(xlim=(low[0] - pad, high[0] + pad), ylim=(low[1] - pad, high[1] + pad), aspect="equal")
    axes.set_axis_off()


def save_smooth(figure: Figure, out: Path, dpi: int) -> None:
    """Save with antialiased faces; PNG only, other formats unchanged."""
    if out.suffix.lower() != ".png":
        save_figure(figure, out, dpi=dpi)
        return
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.image import imsave  # noqa: PLC0415

    figure.set_dpi(FINER * dpi)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(np.float64)
    height, width = (n - n % FINER for n in pixels.shape[:2])
    blocks = pixels[:height, :width].reshape(height // FINER, FINER, width // FINER, FINER, 3)
    smooth = blocks.mean(axis=(1, 3)).round().astype(np.uint8)
    with replacing(out) as temporary:
        imsave(temporary, smooth, format="png", dpi=dpi, pil_kwargs={"optimize": True})
