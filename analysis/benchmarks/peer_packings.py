"""Packings of discs and spheres compared with spheropack and JaxDEM: core seconds, packing fractions and contacts.

    python -m venv peers && peers/bin/pip install spheropack git+https://github.com/cdelv/JaxDEM
    python analysis/benchmarks/peer_packings.py --spheropack peers/bin/python --seeds 3 --out runs/peer_packings
    python analysis/benchmarks/peer_packings.py --jaxdem peers/bin/python --cases discs --n 64 256 --out runs/peer_packings

Each packing is made in a process of its own with one thread, one of ours and one of the other's after it;
its seconds are those in which the processor was busy, without imports. Ours are by the usual way, of soft particles
whose forces balance. spheropack's are of hard ones by the event-driven algorithm of Lubachevsky and Stillinger, with the
slow steps with which its documentation has 98 % of the isostatic contacts, Jammed(step=0.1). JaxDEM's are of soft ones as its
example jam_spheres makes them (its `bisection_jam` with FIRE, to an energy of 1e-16 a particle, compilation included), with its
neighbour list. Discs are of two sizes, 1 and 1.4, as many of each. Contacts are told over those of an isostatic packing of what is
no rattler; JaxDEM's are not counted. One that takes longer than --seconds by the clock is given up. What is finished is kept. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.files.disk import store

CASES: dict[str, tuple[int, str, tuple[int, ...]]] = {
    "discs": (2, "js.Spherocylinders(alpha=0)", (256, 1024)),
    "spheres": (3, "js.Superellipsoids(p=1, w1=1, w2=1)", (400, 1000)),
}

OURS = """
import json, time
import jamshape as js
began = time.process_time()
found = js.make_packing({shape}, n={n}, seed={seed}, progress=False).results
seconds = time.process_time() - began
contacts = found["n_contacts"] / ({D} * (found["n"] - found["n_rattlers"] - 1))
print(json.dumps({{"seconds": seconds, "phi": found["phi_J"], "contacts": contacts, "outcome": found["outcome"]}}))
"""

PEER = """
import json, time
import spheropack as sp
radii = [1.4 if {D} == 2 and k % 2 else 1.0 for k in range({n})]
began = time.process_time()
found = sp.pack(radii=radii, container=sp.Box([1.0] * {D}), density="max", seed={seed}, stop=[sp.stop.Jammed(step=0.1)])
seconds = time.process_time() - began
contacts = sp.analysis.isostaticity(found)
print(json.dumps({{"seconds": seconds, "phi": found.density, "contacts": contacts, "outcome": found.status}}))
"""

JAXDEM = """
import json, time
import jax, jax.numpy as jnp, jaxdem
jax.config.update("jax_enable_x64", True)
D, n = {D}, {n}
radius = jnp.array([0.7 if D == 2 and k % 2 else 0.5 for k in range(n)])
volume = (jnp.pi * radius**2 if D == 2 else 4 / 3 * jnp.pi * radius**3)
edge = (volume.sum() / 0.4) ** (1 / D)
began = time.process_time()
position = jax.random.uniform(jax.random.PRNGKey({seed}), (n, D), minval=0.0, maxval=edge)
material = jaxdem.Material.create("elastic", young=1.0, poisson=0.5, density=1.0)
table = jaxdem.MaterialTable.from_materials([material], matcher=jaxdem.MaterialMatchmaker.create("harmonic"))
state = jaxdem.State.create(pos=position, rad=radius, mass=jnp.ones(n), volume=volume)
near = dict(state=state, cutoff=2 * float(radius.max()), skin=0.3, max_neighbors=24 if D == 2 else 40)
system = jaxdem.System.create(
    state_shape=state.shape, dt=1e-2, minimizer=jaxdem.minimizers.fire, minimizer_kw=dict(dt=1e-2), domain_type="periodic",
    force_model_type="spring", collider_type="neighbor_list", collider_kw=near, mat_table=table,
    domain_kw=dict(box_size=edge * jnp.ones(D)))
found = jaxdem.utils.jamming.bisection_jam(state, system, verbose=False)
phi = float(found.packing_fraction)
seconds = time.process_time() - began
print(json.dumps({{"seconds": seconds, "phi": phi, "contacts": None, "outcome": "jammed"}}))
"""

PEERS = {"spheropack": PEER, "jaxdem": JAXDEM}


class Task(NamedTuple):
    """One packing, and who makes it."""

    case: str
    n: int
    seed: int
    maker: str

    @property
    def code(self) -> str:
        """Code that makes it and prints its cost."""
        D, shape, _ = CASES[self.case]
        code = PEERS.get(self.maker, OURS)
        return code.format(D=D, shape=shape, n=self.n, seed=self.seed)


def parser() -> ArgumentParser:
    """Make the parser."""
    found = parser_of(__doc__, "runs/peer_packings")
    add = found.add_argument
    for name in PEERS:
        add(f"--{name}", type=Path, help=f"a Python that has {name}")
    add("--cases", nargs="*", default=list(CASES), choices=list(CASES), help="(all)")
    add("--n", type=int, nargs="*", help="particles (those of each case)")
    add("--seeds", type=int, default=3, help="packings of each (3)")
    add("--seconds", type=float, default=600.0, help="after which one is given up (600)")
    return found


def main(options: Namespace) -> None:
    """Make what is missing and print the table."""
    if not peers_of(options):
        msg = "no peer was given, expected --spheropack or --jaxdem with a Python that has it"
        raise ValueError(msg)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = [made(task, options) for task in tasks(options)]
    print("| | N | | core s, median (range) | phi_J | contacts over isostatic | ends |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for key in dict.fromkeys((row["case"], row["n"], row["maker"]) for row in rows):
        group = [row for row in rows if (row["case"], row["n"], row["maker"]) == key]
        print("| " + " | ".join(told(group)) + " |")
    report({"out": options.out, "rows": rows})


def peers_of(options: Namespace) -> dict[str, Path]:
    """List the peers that take part, with their Python."""
    found = {name: getattr(options, name) for name in PEERS}
    return {name: python for name, python in found.items() if python}


def tasks(options: Namespace) -> Iterator[Task]:
    """List all packings, in turns."""
    for case in options.cases:
        for n in options.n or CASES[case][2]:
            for seed in range(1, options.seeds + 1):
                for maker in ("jamshape", *peers_of(options)):
                    yield Task(case, n, seed, maker)


def made(task: Task, options: Namespace) -> dict[str, Any]:
    """Make a packing, unless it is there, and tell what it took."""
    path = options.out / f"{task.case}_n{task.n}_seed{task.seed}_{task.maker}.json"
    if path.exists():
        kept: dict[str, Any] = json.loads(path.read_text())
        return kept
    python = str(peers_of(options).get(task.maker, sys.executable))
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
    threads["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"
    try:
        done = subprocess.run(
            [python, "-c", task.code],
            capture_output=True,
            text=True,
            env=os.environ | threads,
            check=False,
            timeout=options.seconds,
        )
    except subprocess.TimeoutExpired:
        nothing = {"seconds": options.seconds, "phi": math.nan, "contacts": None}
        return task._asdict() | nothing | {"outcome": "given up"}
    if done.returncode:
        msg = f"{task.maker} made no packing of {task.n} {task.case}: {done.stderr.strip()[-300:]}"
        raise RuntimeError(msg)
    found: dict[str, Any] = task._asdict() | json.loads(done.stdout)
    store(path, json.dumps(found).encode())
    return found


def told(group: list[dict[str, Any]]) -> list[str]:
    """Make the line of a table."""
    first, seconds = group[0], [row["seconds"] for row in group]
    return [
        first["case"],
        str(first["n"]),
        first["maker"],
        f"{np.median(seconds):.3g} ({min(seconds):.3g} to {max(seconds):.3g})",
        f"{np.mean([row['phi'] for row in group]):.4f}",
        f"{np.mean([row['contacts'] for row in group]):.4f}" if first["contacts"] else "",
        ", ".join(sorted({row["outcome"] for row in group})),
    ]


if __name__ == "__main__":
    run(parser(), main)
