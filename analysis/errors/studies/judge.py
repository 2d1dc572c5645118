"""Contacts of superellipsoids by mpmath, in a formulation of their own: a judge of the reference.

The scale at which two bodies touch is the largest r.n / (h_i(n) + h_j(n)) over all normals n, h the support functions.
With u across n, its slope along u is zero where u.(x_i + x_j - r) is, x the points of the scaled bodies with this
normal: D - 1 equations for as many unknowns, solved by Newton's method in 60 digits with differences as slopes.
"""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np

from studies.touching import Couples

DIGITS = 60
STEPS = 30


class _Body:
    """A row of `Couples`."""

    def __init__(self, row: Any, D: int) -> None:
        mp = mpmath.mpf
        turn, rest = row[D : D + (1 if D == 2 else 4)], row[D + (1 if D == 2 else 4) :]
        self.centre = [mp(float(x)) for x in row[:D]]
        self.axes, p = [mp(float(x)) for x in rest[:D]], mp(float(rest[D]))
        self.q = 2 * p / (2 * p - 1)
        if D == 2:
            c, s = mpmath.cos(mp(float(turn[0]))), mpmath.sin(mp(float(turn[0])))
            self.frame = [[c, s], [-s, c]]
        else:
            w, x, y, z = (mp(float(q)) for q in turn)
            size = w * w + x * x + y * y + z * z
            self.frame = [
                [(w * w + x * x - y * y - z * z) / size, 2 * (x * y + w * z) / size, 2 * (x * z - w * y) / size],
                [2 * (x * y - w * z) / size, (w * w - x * x + y * y - z * z) / size, 2 * (y * z + w * x) / size],
                [2 * (x * z + w * y) / size, 2 * (y * z - w * x) / size, (w * w - x * x - y * y + z * z) / size],
            ]  # fmt: skip

    def width(self, n: list[Any]) -> tuple[Any, list[Any]]:
        """Support function and the point with this normal."""
        t = [a * _dot(u, n) for a, u in zip(self.axes, self.frame, strict=True)]
        h = sum(abs(x) ** self.q for x in t) ** (1 / self.q)
        part = [mpmath.sign(x) * (abs(x) / h) ** (self.q - 1) for x in t]
        point = [
            sum(a * s * u[k] for a, s, u in zip(self.axes, part, self.frame, strict=True))
            for k in range(len(n))
        ]
        return h, point


def _dot(a: list[Any], b: list[Any]) -> Any:
    return sum(x * y for x, y in zip(a, b, strict=True))


class _Pair:
    def __init__(self, couples: Couples, m: int, normal: list[Any]) -> None:
        self.i, self.j = (
            _Body(couples.i[m], couples.dimension),
            _Body(couples.j[m], couples.dimension),
        )
        self.r = [a - b for a, b in zip(self.i.centre, self.j.centre, strict=True)]
        self.begin = normal
        if len(normal) == 2:
            self.across = [[-normal[1], normal[0]]]
        else:
            self.across = self._plane(normal)

    @staticmethod
    def _plane(n: list[Any]) -> list[list[Any]]:
        least = min(range(3), key=lambda k: abs(n[k]))
        beside = [mpmath.mpf(k == least) for k in range(3)]
        u = [n[1] * beside[2] - n[2] * beside[1], n[2] * beside[0] - n[0] * beside[2],
             n[0] * beside[1] - n[1] * beside[0]]  # fmt: skip
        v = [n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]]
        return [u, v]

    def normal(self, t: list[Any]) -> list[Any]:
        return [
            n + sum(a * u[k] for a, u in zip(t, self.across, strict=True))
            for k, n in enumerate(self.begin)
        ]

    def slopes(self, *t: Any) -> list[Any]:
        """Zero at the solution."""
        n = self.normal(list(t))
        (h_i, x_i), (h_j, x_j) = self.i.width(n), self.j.width(n)
        eta = _dot(self.r, n) / (h_i + h_j)
        apart = [eta * (a + b) - r for a, b, r in zip(x_i, x_j, self.r, strict=True)]
        return [_dot(u, apart) for u in self.across]

    def _step(self, t: list[Any], at: list[Any]) -> list[Any] | None:
        """Newton's step, or None where the matrix of slopes is singular."""
        small = mpmath.mpf(10) ** (-DIGITS // 2)
        rows = mpmath.matrix(len(t))
        for col in range(len(t)):
            beside = [x + (small if k == col else 0) for k, x in enumerate(t)]
            for row, (x, y) in enumerate(zip(self.slopes(*beside), at, strict=True)):
                rows[row, col] = (x - y) / small
        try:
            return list(mpmath.lu_solve(rows, mpmath.matrix(at)))
        except ZeroDivisionError:
            return None

    def _root(self) -> list[Any] | None:
        t = [mpmath.mpf(0)] * len(self.across)
        at = self.slopes(*t)
        for _ in range(STEPS):
            step = self._step(t, at)
            if step is None:
                return None
            for cut in range(STEPS):
                beside = [x - y / 2**cut for x, y in zip(t, step, strict=True)]
                there = self.slopes(*beside)
                if _dot(there, there) < _dot(at, at):
                    break
            else:
                return None
            t, at = beside, there
            if _dot(step, step) < mpmath.mpf(10) ** (-DIGITS):
                return t
        return None

    def solved(self) -> tuple[Any, list[Any]] | None:
        """Energy and force, or None where Newton's method does not converge."""
        t = self._root()
        if t is None:
            return None
        n = self.normal(list(t))
        along = _dot(self.r, n)
        eta = along / (self.i.width(n)[0] + self.j.width(n)[0])
        overlap = 1 - eta**2
        return overlap**2 / 2, [2 * overlap * eta**2 * x / along for x in n]


def judged(couples: Couples, exact: Any) -> dict[str, float]:
    """Largest relative differences of energies and forces, over those that the reference states where larger."""
    worst = {"pairs": 0, "not_solved": 0, "energy": 0.0, "force": 0.0}
    with mpmath.workdps(DIGITS):
        for m in range(len(couples.i)):
            force = [mpmath.mpf(float(x)) for x in exact.force[m].astype(float)]
            size = mpmath.sqrt(_dot(force, force))
            found = _Pair(couples, m, [x / size for x in force]).solved()
            worst["pairs"] += 1
            if found is None:
                worst["not_solved"] += 1
                continue
            energy, by = found
            off = [abs(_long(exact.energy[m]) - energy) / energy,
                   mpmath.sqrt(sum((_long(a) - b) ** 2 for a, b in zip(exact.force[m], by, strict=True))) / size]  # fmt: skip
            doubt = exact.errors[m] / np.array([float(energy), float(size), 1.0])
            for name, x, stated in zip(("energy", "force"), off, doubt, strict=False):
                if x > 3 * stated + 1e-18:  # numbers of the reference come as long doubles
                    worst[f"{name}_beyond"] = worst.get(f"{name}_beyond", 0) + 1
                worst[name] = max(worst[name], float(x))
    return worst


def _long(x: Any) -> Any:
    leading = float(x)
    return mpmath.mpf(leading) + mpmath.mpf(float(x - np.longdouble(leading)))
