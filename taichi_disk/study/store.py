"""Where the points of a sweep are kept: each as its scene and its result, which is there whole or not at all."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from taichi_disk import __version__
from taichi_disk.errors import InputError
from taichi_disk.results import write_text
from taichi_disk.scene import Scene
from taichi_disk.study.program import fingerprint
from taichi_disk.study.work import PointResult


def point_key(scene: Scene) -> str:
    """Name of a point: a hash of its resolved scene and of the program, so that results of two programs never mix.

    The film's settings are no part of it.
    """
    numbers = scene.model_dump(exclude={"video"})
    return hashlib.sha256(json.dumps([fingerprint(), numbers], sort_keys=True).encode()).hexdigest()[:20]


class PointStore:
    """The folder `points` of a sweep: KEY.yaml, a point's resolved scene, and KEY.json, its result."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> PointResult | None:
        """The result kept under `key`, if any. Raises InputError for a file that this program did not write."""
        path = self._folder / f"{key}.json"
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
            return PointResult(record["status"], record["reason"], record["numbers"])
        except FileNotFoundError:
            return None
        except (ValueError, KeyError, TypeError, OSError) as error:
            raise InputError(
                f"{path}: not the result of a point ({error}); delete the file to compute it anew"
            ) from None

    def put(self, key: str, scene: Scene, result: PointResult) -> None:
        self._folder.mkdir(exist_ok=True)
        # The result last: where it is, the point is done.
        write_text(self._folder / f"{key}.yaml", scene.to_yaml())
        record = asdict(result) | {"version": __version__}
        write_text(self._folder / f"{key}.json", json.dumps(record, indent=1, allow_nan=False) + "\n")
