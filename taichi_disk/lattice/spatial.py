"""SciPy's Delaunay triangulation and k-d tree, without imports that take 0.2 s and that
they do not need.

`scipy.spatial` also imports distances and rotations, so an empty package of the same
name replaces it while the two extension modules are imported. SciPy also copies all
names of NumPy, which loads modules that NumPy otherwise loads on demand, so two large
ones are meanwhile None. Afterwards `import scipy.spatial` gives the whole package as
usual.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import scipy

_NAME = "scipy.spatial"

_package = sys.modules.get(_NAME)
if _package is None:
    sys.modules[_NAME] = ModuleType(_NAME)
    sys.modules[_NAME].__path__ = [str(Path(scipy.__file__).with_name("spatial"))]
_on_demand = {"f2py", "testing"} - vars(np).keys()
vars(np).update(dict.fromkeys(_on_demand))
try:
    from scipy.spatial._ckdtree import cKDTree
    from scipy.spatial._qhull import Delaunay, QhullError
finally:
    for name in _on_demand:
        del vars(np)[name]
    if _package is None:
        del sys.modules[_NAME]

__all__ = ["Delaunay", "QhullError", "cKDTree"]
