"""The printed result: no more digits than are significant, with the error beside it."""

from pathlib import Path

import pytest

from taichi_disk.runs.output.report import print_result, print_time, shown

LABELS = {"restitution": ("restitution e", ""), "contact_time": ("contact time", "R/c")}


def printed(capsys):
    """Return the lines on the screen, without the blanks between columns."""
    return [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]


SUMMARY = {
    "restitution": 0.967234123,
    "contact_time": 4.12345678,
    "dt": 0.0123456789,
    "steps": 1234,
    "integrator": "trapezoidal",
    "energy": {"closing_imbalance": 1.234e-6},
    "error_estimate": {"restitution": 1.6e-5},
    "wall_clock": {"import": 1.04, "simulate": 0.34, "plot": 0.12},
}


@pytest.mark.parametrize(
    ("value", "error", "text", "plus_minus"),
    [
        (0.967234123, 3.2e-5, "0.967234", "3.2e-5"),
        (0.967234123, 1.34e-5, "0.967234", "1.4e-5"),
        (0.967234123, 0.0, "0.967234123000", "9.7e-11"),
        (4.123, 0.5, "4.12", "0.50"),
        (4.123, 30.0, "4", "30"),
        (-0.3, 1e-3, "-0.3000", "0.0010"),
        (0.967359, 4.81e-4, "0.96736", "0.00049"),
        (0.967359, 9.99e-5, "0.967359", "1.00e-4"),
        (1.23456789e-9, 1.5e-15, "1.2345679e-9", "1.5e-15"),
        (0.0, 1e-5, "0.000000", "1.0e-5"),
        (-2e-17, 3e-15, "0", "3.0e-15"),
        # a power of ten below 1e-4
        (1.234e-4, 1e-9, "0.0001234000", "1.0e-9"),
        (0.9876e-4, 1e-9, "9.87600e-5", "1.0e-9"),
    ],
)
def test_a_value_ends_where_its_error_does(value, error, text, plus_minus):
    assert shown(value, error) == (text, f"± {plus_minus} (time step)")


def test_the_error_is_never_understated():
    for k in range(1, 2000):
        error = k * 7.7e-9
        assert error <= float(shown(0.9, error)[1].split()[1]) <= 1.1 * error


def test_without_an_estimate_few_digits_are_shown_unless_there_are_no_steps():
    for error in (None, float("nan"), float("inf")):
        assert shown(0.967234123, error) == ("0.9672", "")
        assert shown(0.967234123, error, exact=True) == ("0.96723412", "")


def test_the_screen_says_the_result_how_it_was_computed_and_how_long_that_took(capsys):
    print_result(SUMMARY, LABELS, Path("out/run-2"))
    print_time(SUMMARY)
    assert printed(capsys) == [
        "restitution e 0.967234 ± 1.6e-5 (time step, this lattice only)",
        "contact time 4.123 R/c",
        "time step 0.0123457 R/c",
        "steps 1,234 (trapezoidal)",
        "energy imbalance at the end 1.23e-06",
        "files in out/run-2",
        "wall clock 1.5 s (import 1.0, simulate 0.3, plot 0.1)",
    ]
    print_result(SUMMARY | {"error_estimate": {}}, LABELS, Path("o"))
    unknown = "0.9672 (error of the time step not estimated)"
    assert unknown in capsys.readouterr().out
    # The result to quote comes first: the mean over lattices, with their scatter.
    e = {
        "values": [0.967234, 0.9664],
        "mean": 0.966817,
        "standard_deviation": 5.8e-4,
        "standard_error": 4.1e-4,
        "interval_95": [0.966817 - 5.21e-3, 0.966817 + 5.21e-3],
    }
    lattices = {"seeds": [4, 5], "restitution": e}
    print_result(SUMMARY | {"seed": 4, "lattices": lattices}, LABELS, Path("o"))
    assert printed(capsys)[:3] == [
        "restitution e 0.9668 ± 0.0053 (95 % interval, mean of 2 lattices), lattice to"
        " lattice 0.00058",
        "seed 4 0.967234 ± 1.6e-5 (time step, this lattice only)",
        "contact time 4.123 R/c (this lattice only: another has no such result)",
    ]
    gained = SUMMARY | {"gained_from": "vibration 3 %"}
    print_result(gained, LABELS, Path("o"))
    assert printed(capsys)[1] == "energy became flight: vibration 3 %"
    # An equilibrium has no step.
    newton = {"xi": 0.0150123456789, "steps": 7, "integrator": "newton"}
    newton["wall_clock"] = {"simulate": 0.1}
    print_result(newton, {"xi": ("compression ξ", "R")}, Path("o"))
    expected = ["compression ξ 0.015012346 R", "iterations 7 (newton)"]
    assert printed(capsys)[:2] == expected
