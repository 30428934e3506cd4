"""Programs that tests start, and what a run has left."""

import base64
import json
import re
import subprocess
import sys
import zlib
from functools import cache

import numpy as np
from PIL import Image

from taichi_disk.base.errors import NoPictures
from taichi_disk.pictures.render.artist import Artist


def python(*words, program=sys.executable, **options):
    """Run Python with these arguments, and return the process that has ended."""
    line = [program, *map(str, words)]
    return subprocess.run(line, **{"capture_output": True, "text": True} | options)


def printed_by(*words, **options):
    """Return what Python prints with these arguments. It must end without an error."""
    done = python(*words, **options)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def command(*words, **options):
    """Run `taichi-disk` in a process of its own."""
    return python("-m", "taichi_disk", *words, **options)


@cache
def film_problem():
    """Return why this machine cannot make films, or None."""
    try:
        Artist().require_film()
    except NoPictures as problem:
        return str(problem)
    return None


def summary_in(folder):
    return json.loads((folder / "summary.json").read_text())


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def packed(path):
    """Return the JSON and the bytes in a film that is a page."""
    text = re.search(r'id="states">([^<]*)<', path.read_text())[1]
    data = zlib.decompress(base64.b64decode(text))
    length = int(np.frombuffer(data[:4], "<u4")[0])
    return json.loads(data[4 : 4 + length]), data[4 + length :]


def durations_of(path):
    """Return how long each picture of a GIF is shown [ms]."""
    durations = []
    with Image.open(path) as gif:
        for k in range(gif.n_frames):
            gif.seek(k)
            durations.append(gif.info["duration"])
    return durations
