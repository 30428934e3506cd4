"""Measure times in turn, and print ratios."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from statistics import median

Costs = dict[str, list[float]]


def in_turn(runs: Mapping[str, Callable[[], float]], repeats: int) -> Costs:
    """Return the costs of each run, called `repeats` times in turn (A B C A B C ...) to
    share disturbances."""
    costs: Costs = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            costs[name].append(run())
    return costs


def table(
    title: str, costs: Costs, unit: str = "s", remarks: Mapping[str, str] | None = None
) -> Iterator[str]:
    """Yield a table of ratios to the first row (medians over the turns), and the
    smallest and median cost."""
    base = next(iter(costs.values()))
    yield f"{title:<62}{'ratio':>8}{'min':>9}{'median':>9}  {unit}"
    for name, own in costs.items():
        ratio = median(one / other for one, other in zip(own, base, strict=True))
        remark = (remarks or {}).get(name, "")
        yield (
            (
                f"  {name:<60}{ratio:8.2f}{min(own):9.3g}{median(own):9.3g}  {remark}"
            ).rstrip()
        )
