"""Protocols: random starts, approaches to jamming, and complete pipelines."""
