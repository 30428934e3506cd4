"""Notices for the user, as records of the logger `taichi_disk`.

The command line prints all of them. In Python warnings are printed to stderr, and
`logging.basicConfig(level="INFO")` prints the others, too.
"""

from __future__ import annotations

import logging

NOTICES = logging.getLogger("taichi_disk")
