"""What a scene file may say, and how one is read: no NumPy, no Taichi."""
