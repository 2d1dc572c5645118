"""Jamming of soft, frictionless, athermal particles that are not round.

>>> import jamshape as js
>>> rods = js.Spherocylinders(alpha=4)
>>> packing = js.make_packing(rods, n=16, u0=1e-8, progress=False)
>>> packing.n, packing.results["outcome"]
(16, 'converged')

Names are loaded on first use, so that the import is quick and needs neither LAMMPS nor HDF5 nor
matplotlib; ``__init__.pyi`` lists them.
"""

try:
    import lazy_loader as _lazy
except ImportError as _error:  # scripts report it in a sentence
    _missing = _error

    def _load(_name):  # type: ignore[no-untyped-def]
        raise _missing
else:
    _load, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)


def __getattr__(name):  # type: ignore[no-untyped-def]
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 - slow

        try:
            return version(__name__)
        except PackageNotFoundError:
            return "0+not.installed"
    if name == "MeasuredPacking":
        from jamshape.old_names import renamed_class  # noqa: PLC0415 - only where it is asked for

        return renamed_class(name, _load("Packing"))
    return _load(name)
