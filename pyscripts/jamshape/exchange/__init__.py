"""Packings in other programs: GSD files, freud, OVITO and MDAnalysis, each in a module of its name.

None of them is needed by the rest of the library; ``pip install 'jamshape[exchange]'`` brings them all.
"""
