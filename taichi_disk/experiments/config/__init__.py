"""Scene files: their keys, and how they are read. Without NumPy and Taichi."""
