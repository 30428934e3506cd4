"""SciPy's Delaunay triangulation and k-d tree, without the rest of `scipy.spatial`, whose import takes 0.12 s.

The package itself imports the rest (distances, rotations), so an empty package of the same name replaces it while the
two extension modules are imported. Afterwards `import scipy.spatial` gives the whole package as usual.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import scipy

_NAME = "scipy.spatial"

_package = sys.modules.get(_NAME)
if _package is None:
    sys.modules[_NAME] = ModuleType(_NAME)
    sys.modules[_NAME].__path__ = [str(Path(scipy.__file__).with_name("spatial"))]
try:
    from scipy.spatial._ckdtree import cKDTree
    from scipy.spatial._qhull import Delaunay, QhullError
finally:
    if _package is None:
        del sys.modules[_NAME]

__all__ = ["Delaunay", "QhullError", "cKDTree"]
