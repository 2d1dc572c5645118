"""Settings that make our decks short, and the files that they leave beside log and restart."""

SMALL = {
    "compress_spherocylinder": {"n": 16, "kappa": 1e-2, "dt": 0.1, "phi_end": 0.8, "frames": 4},
    "compress_superellipsoid": {"n": 12, "kappa": 4e-3, "phi_end": 0.6, "frames": 4},
    "minimize_spherocylinder": {"maxiter": 10},
    "minimize_superellipsoid": {"maxiter": 10},
}
LEFT = {
    "compress_spherocylinder": {"initial.data", "particles.dump", "contacts.dump"},
    "compress_superellipsoid": {"initial.data", "particles.dump", "contacts.dump", "final.data"},
    "minimize_spherocylinder": {"final.data"},
    "minimize_superellipsoid": {"final.data"},
}
