"""Damaged and hostile files, read by every reader in a process of its own."""

import json
import resource
from functools import partial

import h5py
import numpy as np

import jamshape as js
from jamshape.files import h5md
from jamshape.files.content import Content
from jamshape.packing import Packing, State
from jamshape.vibration.table import ModeTable, read_modes

FIELDS = (
    *("position", "orientation", "diameters", "species", "id", "image", "step", "time", "law"),
    *("position_rest", "orientation_rest", "edges_rest", "tilt_rest", "shape_style", "exponent"),
)
READERS = (
    *("read_packing", "count_frames", "read_attributes", "read_observables", "read_report"),
    *("read_style", "read_creator", "read_origin", "read_format_version"),
)


def flat(thing):
    """Convert content to what can be compared bit by bit."""
    if isinstance(thing, np.ndarray):
        return (thing.dtype.str, thing.shape, thing.tobytes())
    if isinstance(thing, dict):
        return sorted((name, flat(value)) for name, value in thing.items())
    if isinstance(thing, State):
        return flat(list(thing.split))
    if isinstance(thing, Packing):
        fields = [flat(getattr(thing, name)) for name in FIELDS]
        box = [flat(x) for x in (thing.box.lo, thing.box.edges, thing.box.tilt)]
        return [*fields, *box]
    if isinstance(thing, ModeTable):
        c = thing.coordinates
        arrays = [thing.vectors, c.particle, c.kind, c.direction, thing.singular_values]
        return [
            flat(thing.columns),
            *map(flat, arrays),
            c.n_all,
            c.dimension,
            flat(thing.attributes),
        ]
    if isinstance(thing, tuple | list):
        return [flat(value) for value in thing]
    return repr(thing)


def loaded(path):
    """Load and read everything."""
    found = js.load(path)
    if isinstance(found, Packing):
        return [flat(found), flat(found.results)]
    if hasattr(found, "told"):
        return flat(found.told)
    return [flat(found.about), flat(found.observables), [flat(packing) for packing in found]]


def content(path):
    """Read what a run goes on from."""
    found = Content.read(path)
    columns = {name: vars(column) for name, column in found.columns.items()}
    return [flat(found.checkpoint), flat(columns), flat(found.report), flat(found.frames)]


def every_series(path):
    return [flat(h5md.read_series(path, name)) for name in h5md.read_observables(path)]


def by_h5py(path):
    """Read everything as other programs do."""
    found = []

    def take(name, item):
        found.append((name, flat(dict(item.attrs))))
        if isinstance(item, h5py.Dataset):
            found.append(flat(item[()]))

    with h5py.File(path) as file:
        file.visititems(take)
    return found


def readers_of(kind):
    ours = {"load": loaded}
    if kind == "unfinished":
        ours["content"] = content
    if kind in {"packing", "run", "unfinished"}:
        ours |= {name: getattr(h5md, name) for name in READERS} | {"series": every_series}
    if kind == "run":
        ours["first"] = partial(h5md.read_packing, frame=0)
    if kind == "modes":
        ours["read_modes"] = read_modes
    return ours


def outcome_of(read, path):
    """Return content, or the sentence of a refusal."""
    try:
        return flat(read(path))
    except (ValueError, OSError) as error:
        return error


def fault_of(found, original, path):
    """Describe what is wrong with an outcome; "" if nothing is."""
    if not isinstance(found, Exception):
        same = not isinstance(original, Exception) and found == original
        return "" if same else "wrong content"
    text = str(found)
    is_sentence = text and "\n" not in text and len(text) < 500 and str(path) in text
    return "" if is_sentence else f"{type(found).__name__} {text!r}"


def damaged(job, whole):
    how, number = job
    if how == "cut":
        return whole[:number]
    data = bytearray(whole)
    place = int(np.random.default_rng(number).integers(8 * len(data)))
    data[place // 8] ^= 1 << place % 8
    return bytes(data)


def tried(job, kind, whole, path, originals):
    """Read a damaged file with every reader."""
    if job[0] == "read":
        path = path.with_name(job[1])
    else:
        path.write_bytes(damaged(job, whole))
    result = {"same": [], "refused": [], "faults": []}
    for name, read in readers_of(kind).items():
        found = outcome_of(read, path)
        if fault := fault_of(found, originals[name], path):
            result["faults"].append(f"{name}: {fault}")
        else:
            result["refused" if isinstance(found, Exception) else "same"].append(name)
    if job[0] != "read":
        try:
            found = by_h5py(path)
        except Exception:  # noqa: BLE001 - of whatever type
            found = None
        if found not in (None, originals["h5py"]):
            result["faults"].append("h5py: wrong content")
    return result


def read_all(kind, file, folder, jobs):
    """Read damaged files of a kind, and write what came of it as results.json of the folder.

    A job is ["flip", SEED], ["cut", LENGTH], or ["read", NAME] for another file of the folder. Results, an item for each job,
    are how many readers returned the original content and how many refused the file with one sentence, and complaints
    about all others; beside them are readers that refuse the original.
    """
    whole, path = file.read_bytes(), folder / f"{kind}.h5"
    path.write_bytes(whole)
    originals = {name: outcome_of(read, path) for name, read in readers_of(kind).items()}
    originals["h5py"] = by_h5py(path)
    before, results = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, []
    for job in jobs:
        results.append(tried(job, kind, whole, path, originals))
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        if grown > 300_000:  # kB
            results[-1]["faults"].append(f"took {grown} kB of memory")
    refused = [name for name, found in originals.items() if isinstance(found, Exception)]
    (folder / "results.json").write_text(json.dumps({"refused": refused, "results": results}))
