"""What can go wrong, as values that carry their advice; the command line turns each into an exit status."""

from __future__ import annotations


class TaichiDiskError(Exception):
    """Base of every error that a user is meant to read."""

    exit_status = 1


class InputError(TaichiDiskError):
    """A scene, an option or a path that cannot be used. Nothing has been computed or written."""

    exit_status = 2


class SimulationError(TaichiDiskError):
    """The computation was begun and could not be finished: a blow-up, no convergence, no separation in time."""
