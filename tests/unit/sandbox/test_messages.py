"""What a sandbox sends to its page, compared with a recording (see shown.py)."""

import json
import re
from itertools import groupby

import numpy as np
from shown import digest, number, numbers

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
    *12 * (None,),
    {"do": "scrub", "t": 3.0},
    {"do": "press", "key": "space"},
    None,
    {"do": "press", "key": "space"},
    {"do": "set", "key": "video.colour", "value": "kinetic"},
    {"do": "play", "number": 1},
    {"do": "press", "key": "x"},
    {"do": "play", "number": 2},
    {"do": "set", "key": "compression.pressure", "value": 0.2},
)


def test_a_page_is_sent_what_is_recorded(playlist, kernels, record, monkeypatch):
    monkeypatch.setattr("taichi_disk.sandbox.sandbox.perf_counter", lambda: 0.0)
    session = Session(playlist, kernels)
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
            yield f"  graphs: {content['motion']} {digest(content['t'])}"
            values = np.round(content["values"], 9)  # without rounding errors
            largest = np.abs(values).max(axis=1, initial=1e-9)
            yield f"  graphs: {digest(values / largest[:, None])} of {numbers(largest)}"
        else:
            yield from flat(content, f"  {kind}")


def flat(value, place):
    """Yield a line for each part that has no parts itself."""
    if isinstance(value, dict):
        parts = value
    elif isinstance(value, list) and not all(map(is_number, value)):
        parts = dict(enumerate(value))
    else:
        yield f"{place}: {text_of(value)}"
        return
    if all(map(is_text, parts.values())):
        records = [
            ", ".join(map(str, one.values() if isinstance(one, dict) else one))
            for one in parts.values()
        ]
        yield f"{place}: {'; '.join(records)}"
        return
    if not any(isinstance(one, (dict, list)) for one in map(plain, parts.values())):
        words = [f"{name} {text_of(plain(one))}" for name, one in parts.items()]
        yield f"{place}: {', '.join(words)}"
        return
    for name, each in parts.items():
        yield from flat(each, f"{place}.{name}")


def text_of(value):
    if is_number(value):
        return number(value)
    if isinstance(value, list):
        return digest(np.where(np.abs(value) < 1e-9, 0.0, value))  # no rounding errors
    if isinstance(value, str) and len(value) > 80 and " " not in value:
        return f"{len(value)} letters"
    return repr(value)


def plain(part):
    """Return a list of words as one text, and anything else as it is."""
    if isinstance(part, list) and part and all(isinstance(one, str) for one in part):
        return ", ".join(part)
    return part


def is_text(record):
    """Whether a part is a record of words only, as that of a key or a curve."""
    values = record
    if isinstance(record, dict):
        values = record.values()
    return isinstance(record, (dict, list)) and all(
        isinstance(one, (str, bool)) for one in values
    )


def is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)
