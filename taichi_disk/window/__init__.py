"""The sandbox: a disk that lives in a window, is changed by hand while it moves, and goes back in time."""
