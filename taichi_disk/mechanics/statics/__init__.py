"""Statics and linear vibrations: equilibria under load, and normal modes about an
equilibrium."""
