"""Progress: a bar on a terminal, which is left in order, and silence elsewhere."""

import errno
import io

import pytest

from taichi_disk.base.progress import terminal


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_without_a_terminal_nothing_is_written():
    stream = io.StringIO()
    with terminal(stream) as progress, terminal(None) as no_stderr:
        for report in (progress, no_stderr):
            report("simulate", 0.0, 10.0)
            report("simulate", 5.0, 10.0)
    assert stream.getvalue() == ""


def test_a_stage_that_ends_early_is_shown_as_complete_and_the_cursor_comes_back():
    # An impact ends when the disk has left, before the time limit.
    stream = Terminal()
    with terminal(stream) as progress:
        progress("simulate", 0.0, 1000.0)
        progress("simulate", 250.0, 1000.0)
        progress("render", 0, 4)
        progress("render", 1, 4)
    lines = [line for line in stream.getvalue().splitlines() if "%" in line]
    simulate, render = lines[-2:]
    assert "simulate" in simulate
    assert "100%" in simulate
    assert "render" in render
    assert "25%" in render
    hidden = "\x1b[?25l"
    shown = "\x1b[?25h"
    assert stream.getvalue().rfind(shown) > stream.getvalue().rfind(hidden) >= 0


def test_text_that_is_printed_between_two_stages_stays():
    stream = Terminal()
    with terminal(stream) as progress:
        progress("simulate", 0.0, 1000.0)
        progress("lattices", 0, 7)
        progress.rest()
        stream.write("numbers\n")
        progress("render", 0, 4)
    later = stream.getvalue().partition("numbers\n")[2]
    assert "render" in later and "simulate" not in later
    assert "\x1b[1A" not in later  # goes up one line


def test_a_remaining_time_says_whether_it_counts_to_the_time_limit():
    for total, limited in ((1000.0, True), (24, False)):
        stream = Terminal()
        with terminal(stream) as progress:
            progress("simulate", 0, total)
        assert ("to the time limit" in stream.getvalue()) is limited


def test_a_stage_whose_end_is_unknown_is_shown_without_a_share():
    stream = Terminal()
    with terminal(stream) as progress:
        progress("simulate", 0, None)
        progress("simulate", 7, None)
    lines = [line for line in stream.getvalue().splitlines() if "simulate" in line]
    assert "%" not in lines[-1]


def test_a_bar_that_was_never_needed_writes_nothing():
    stream = Terminal()
    with pytest.raises(KeyError), terminal(stream):
        raise KeyError
    assert stream.getvalue() == ""


def test_a_terminal_that_has_gone_ends_no_run():
    stream = Terminal()
    with pytest.raises(KeyError), terminal(stream) as progress:
        progress("simulate", 0, None)
        stream.write = broken
        progress("lattices", 1, 2)
        raise KeyError  # and not OSError


def broken(text):
    raise OSError(errno.EIO, "Input/output error")
