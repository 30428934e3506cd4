"""The sandbox: a disk on a page or in a window, which the user changes while it moves
and can send back in time."""
