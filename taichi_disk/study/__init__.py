"""Sweeps over many scenes, and what they say against the paper and the theory."""
