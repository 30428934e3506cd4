"""Progress: a bar where somebody looks, silence elsewhere, and no terminal left in disorder."""

from __future__ import annotations

import io

from taichi_disk.progress import Progress, duration


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_without_a_terminal_nothing_is_written():
    stream = io.StringIO()
    with Progress(stream) as progress:
        progress.start("simulate", 10.0)
        progress.update(5.0)
    assert stream.getvalue() == ""


def test_a_stage_that_ends_early_is_shown_as_complete_and_the_cursor_comes_back():
    # An impact is over when the disk has left, before the time at which it would be given up.
    stream = Terminal()
    progress = Progress(stream)
    progress.stop()
    progress.start("simulate", 1000.0)
    progress.update(250.0)
    progress.start("render", 4.0)
    progress.update(1.0)
    progress.stop()
    progress.stop()
    simulate, render = [line for line in stream.getvalue().splitlines() if "%" in line][-2:]
    assert "simulate" in simulate and "100%" in simulate
    assert "render" in render and "25%" in render
    hidden, shown = "\x1b[?25l", "\x1b[?25h"
    assert stream.getvalue().rfind(shown) > stream.getvalue().rfind(hidden) >= 0


def test_an_expected_time_has_no_more_digits_than_it_is_worth():
    told = [duration(one) for one in (3.0, 44.0, 100.0, 1000.0, 9000.0)]
    assert told == ["10 s", "40 s", "2 min", "17 min", "2.5 h"]
