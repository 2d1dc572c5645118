"""How packings are made: random starts, approaches to jamming, whole paths."""
