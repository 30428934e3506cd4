"""What a sandbox sends to its page, compared with a recording (see shown.py)."""

import json
import re
from itertools import groupby

import numpy as np
from shown import digest, number, numbers, short

from taichi_disk.sandbox.session import Session, read_command

# what a user says, one after the other; None: time passes
ACTS = (
    {"do": "aim", "dx": 0.3, "dy": -0.6},
    {"do": "throw"},
    {"do": "turn", "angle": 0.5, "final": 0},
    {"do": "turn", "angle": 0.5, "final": 1},
    {"do": "set", "key": "material.eta_star", "value": 3.0},
    {"do": "set", "key": "speed", "value": 20.0},
    {"do": "set", "key": "video.draw", "value": "springs"},
    {"do": "set", "key": "video.colour", "value": "force"},
    {"do": "set", "key": "impact.velocity", "value": 3.0},
    {"do": "press", "key": "y"},
    {"do": "press", "key": "space"},
    None,
    {"do": "pull", "x": 0.2, "y": 2.4},
    {"do": "press", "key": "space"},
    {"do": "scrub", "t": 0.2},
    {"do": "release"},
    {"do": "rescale"},
    {"do": "press", "key": "h"},
    {"do": "press", "key": "r"},
    {"do": "press", "key": "space"},
    *3 * (None,),
    {"do": "scrub", "t": 2.0},
    {"do": "play", "number": 1},
    {"do": "play", "number": 2},
)


def test_a_page_is_sent_what_is_recorded(playlist, kernels, record, monkeypatch):
    monkeypatch.setattr("taichi_disk.sandbox.sandbox.perf_counter", lambda: 0.0)
    session = Session(playlist)
    before = [one for one in told(session) if "yaml" in one]
    lines = []
    for act in (None, *ACTS):
        lines.append(json.dumps(act))
        if act:
            session.hear(read_command(json.dumps(act)))
        session.advance()
        if not act:
            session.sandbox.advance(0.05, max_seconds=60.0)
            session.advance()
        found = list(told(session))
        news = [one for one in found if one not in before]
        for _, alike in groupby(news, message_of):
            lines.append(";".join(alike))
        before = found
    record("messages", lines)


def message_of(line):
    """Return the kind of a short line's message, which is read with its neighbours."""
    if len(line) > 60:
        return line
    return re.match(r"  \w+", line)[0]


def told(session):
    """Yield a line for each word and number of the session's present messages; the
    scene as YAML is that of `to_yaml`, so what is noted of it are its changes."""
    for kind, message in session.messages.items():
        if kind == "state":
            header = np.frombuffer(message, "<f4", 8).tolist()
            yield f"  state {' '.join(map(number, header[1:]))}"
            continue
        content = json.loads(message)
        if kind == "yaml":
            values = re.sub(" +#.*", "", content["text"])
            yield from (f"  yaml {line}" for line in values.splitlines())
        elif kind == "graphs":
            axes = f"{content['motion']} {digest(content['t'])}"
            values = np.round(content["values"], 9)  # without rounding errors
            largest = np.abs(values).max(axis=1, initial=1e-9)
            shapes = digest(values / largest[:, None])
            yield f"  graphs: {axes} {shapes} of {numbers(largest)}"
        else:
            for name, part in short(content).items():
                yield from (f"  {kind}.{name}: {text}" for text in texts_of(part))


def texts_of(part):
    """Return a text of a part of a message, or of each record that is listed in it."""
    records = [part]
    if isinstance(part, list) and any(isinstance(one, dict) for one in part):
        records = part
    return [json.dumps(one, ensure_ascii=False) for one in records]
