"""A disk and how it moves: lattice, laws, integrators, kernels, equilibria, fields. It
knows no scene, no file of a scene and no picture."""
