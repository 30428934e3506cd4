"""The disk without motion: equilibria under load, and the normal modes about a rest."""
