"""Ensembles of packings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jamshape.arguments import checked
from jamshape.checks import require_folder, require_stated
from jamshape.front.ensemble_file import EnsembleFile
from jamshape.front.progress import place
from jamshape.front.recorded import recorded
from jamshape.protocols import ensemble as driver
from jamshape.protocols.defaults import recipe_for
from jamshape.recording.workers import cores
from jamshape.shapes.particles import Particles


@checked
def ensemble(
    particles: Particles | None = None,
    *,
    seeds: Sequence[int],
    jobs: int | None = None,
    folder: str | Path | None = None,
    file: str | Path | None = None,
    again: bool = False,
    seconds: float | None = None,
    progress: bool = True,
    **settings: Any,
) -> EnsembleFile:
    """Make one packing for each of many seeds, on all cores, and tabulate their results.

    Rows are the same whatever the number of processes, but for `wall_seconds`.

    Parameters
    ----------
    particles : Particles
        Such as ``Spherocylinders(alpha=4)``.
    seeds : sequence of int
        Random seeds, such as ``range(1000)``, each once.
    jobs : int, optional
        Number of processes, one for each core by default.
    folder : path, optional
        Folder for the packings, ``SHAPE_seedN.h5``, as of ``jamshape sweep``; not kept by default.
    file : path, optional
        H5MD file of the table, as in `compress`; a stopped ensemble resumes from it, also by `resume`.
    again, seconds, progress
        See `compress`.
    **settings
        ``n``, ``u0``, ``protocol`` and other arguments of `make_packing`.

    Returns
    -------
    EnsembleFile
        A table with a column for each result. Samples that fail are rows, too; ``table.failures`` has the reasons.

    Raises
    ------
    ValueError
        If a setting is invalid, a seed occurs twice, or the file holds another ensemble.

    Warns
    -----
    NotReachedWarning
        If samples failed, or their forces do not balance.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> table = js.ensemble(discs, n=16, seeds=range(6), u0=1e-8, file="set.h5", progress=False)
    >>> table["phi_J"].shape, bool((table["u"] < 1.01e-8).all())
    ((6,), True)
    """
    if not len(seeds) or len(set(seeds)) < len(seeds):
        msg = f"seeds has {len(seeds)} numbers, {len(set(seeds))} of them different, expected each once and at least one"
        raise ValueError(msg)
    jobs = cores() if jobs is None else jobs
    require_stated(jobs=jobs)
    recipe = recipe_for(particles, seed=seeds[0], **settings)
    for seed in seeds:
        require_stated(seed=seed)
    if folder is not None:
        require_folder(Path(folder))
        Path(folder).mkdir(parents=True, exist_ok=True)
    at = place(file, "ensemble.h5")
    kept = None if folder is None else Path(folder).absolute()
    plan = driver.plan(recipe, seeds, driver.Means.of(jobs, kept, particles, settings))
    recorded(at.path, plan, again=again, seconds=seconds, progress=progress)
    return EnsembleFile(*at)
