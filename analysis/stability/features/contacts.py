"""Features beside the pair styles and the computes."""

from features.feature import CROWD, Feature

CONTACTS = (Feature("`newton off`", "run 0", "pe", "run 0", 1e-14, scene="newton off\n" + CROWD),)
