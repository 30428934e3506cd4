"""Program of a sweep's process: carry out the calls that come through its input.

The sweep starts it as a file, so that no file of the working folder is imported, not
even one that has the name of a module of the standard library.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import warnings
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue
from typing import Any


def main() -> None:
    """Read pickled messages: first the sweep's module search path, then calls as bytes,
    last None. Write for each call a pair, its value and its error, one of which is
    None."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the sweep handles it
    warnings.simplefilter("ignore")  # as `cli.main` does
    # what libraries print must not come between the results
    output = sys.stdout.fileno()
    _limit(int(sys.argv[1]))
    results = os.fdopen(os.dup(output), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), output)
    requests = SimpleQueue[Any]()
    _find_modules(pickle.load(sys.stdin.buffer))
    threading.Thread(target=_receive, args=(requests,), daemon=True).start()
    while (request := requests.get()) is not None:
        results.write(_answer(request))
        results.flush()


def _limit(memory: int) -> None:
    """Limit the memory of this process [bytes], unless it is 0 or the system cannot."""
    with suppress(ImportError, ValueError):
        import resource

        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))


def _find_modules(search_path: list[str]) -> None:
    """Import modules from where the sweep does, but let none of its folders hide a
    module of the standard library or an installed one."""
    folder = Path(__file__).parent
    own = [entry for entry in sys.path if entry != str(folder)]
    others = [entry for entry in search_path if entry not in own]
    sys.path[:] = [str(folder.parents[2])]
    import_module("taichi_disk")  # the sweep's, if several are installed
    sys.path[:] = own + others


def _receive(requests: SimpleQueue[Any]) -> None:
    """Pass requests on, and end the process at once if the sweep was killed."""
    while True:
        try:
            request = pickle.load(sys.stdin.buffer)
        except (EOFError, OSError, pickle.UnpicklingError):
            os._exit(1)
        requests.put(request)
        if request is None:
            return


def _answer(request: bytes) -> bytes:
    try:
        call = pickle.loads(request)
        return pickle.dumps((call(), None))
    except Exception as error:
        failure = error
    try:
        return pickle.dumps((None, failure))
    except Exception:  # an error may hold what cannot be pickled
        return pickle.dumps((None, RuntimeError(f"{failure!r}")))


if __name__ == "__main__":
    main()
