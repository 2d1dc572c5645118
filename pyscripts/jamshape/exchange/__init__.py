"""Packings in other programs: GSD files, freud, OVITO and MDAnalysis, each in a module of its name.

The rest of the library needs none of them; ``pip install 'jamshape[exchange]'`` installs them all.
"""
