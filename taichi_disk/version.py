"""The version, where every file can have it."""

__version__ = "0.2.0"
