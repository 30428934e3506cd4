"""In notebooks: what results show of themselves, bars, the notebooks of docs."""

import builtins
import sys
from pathlib import Path

import pytest
from programs import film_problem

from taichi_disk import load_sweep, run, run_sweep
from taichi_disk.base.errors import InputError, TaichiDiskError
from taichi_disk.base.progress import reported

ROOT = Path(__file__).parents[2]

SCENE = {
    "scene": "exponential_wall",
    "lattice": {"points": 60},
    "impact": {"velocity": 0.05},
}


@pytest.mark.skipif(film_problem() is not None, reason="no Vulkan driver")
@pytest.mark.usefixtures("one_artist")
def test_a_film_is_shown_inline_with_controls_and_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    result = run(SCENE, lattices=1)
    assert (
        "<video controls loop"
        in (film := result.show(size=64, seconds=0.1))._repr_html_()
    )
    assert film.data[4:8] == b"ftyp"
    assert repr(film) == f"Film(mp4, {round(len(film.data) / 1000)} kB)"
    assert "<img" in result.show(size=64, format="png")._repr_html_()
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="did you mean size"):
        result.show(sise=64)


@pytest.mark.validate
def test_a_sweep_shows_its_fits_and_gives_a_figure_and_a_table(tmp_path, monkeypatch):
    points = "scene: exponential_wall\nlattice: {points: 60}\n"
    done = run_sweep(
        load_sweep(points + "sweep: {velocity: [0.02, 0.05, 0.1]}"),
        tmp_path / "v",
        jobs=1,
    )
    assert repr(done).startswith(
        "SweepResult(exponential_wall, 3 points, 3 of them computed now, 0 failed, out="
    )
    assert "eq. (5)" in (html := done._repr_html_()) and html.count("<img") == 1
    assert done.plot().axes[0].get_xlabel() == "impact speed  v/c"
    assert done.dataframe()["restitution"].tolist() == [
        row["restitution"] for row in done.rows
    ]
    other = run_sweep(
        load_sweep(points + "sweep: {seed: {range: 2}}"), tmp_path / "seed", jobs=1
    )
    html = other._repr_html_()
    assert "eq. (5)" not in html and html.count("<img") == 1
    assert other.plot().axes[0].get_xlabel() == "seed"
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(TaichiDiskError, match="-m pip install 'pandas'"):
        done.dataframe()


def test_long_work_shows_a_bar_in_a_notebook_which_goes_at_the_end(monkeypatch):
    class ZMQInteractiveShell:
        pass

    class Handle:
        def update(self, shown, **_):
            told.append(
                shown
                if isinstance(shown, dict)
                else shown._repr_mimebundle_((), ())["text/plain"]
            )

    told = []
    monkeypatch.setattr(builtins, "get_ipython", ZMQInteractiveShell, raising=False)
    monkeypatch.setattr("IPython.display.display", lambda shown, display_id: Handle())
    monkeypatch.setattr("taichi_disk.base.progress.BAR_INTERVAL", 0.0)

    @reported
    def work(progress=None):
        for k in range(3):
            progress("sweep", k, 2)

    work()
    assert not told  # too soon
    monkeypatch.setattr("taichi_disk.base.progress.BAR_DELAY", 0.0)
    with pytest.raises(InputError, match="progress: must be a function"):
        work(3)
    work(lambda stage, done, total: None)
    assert not told
    work()
    assert "sweep" in told[0] and "100%" in told[-2] and told[-1] == {"text/plain": ""}


NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


@pytest.mark.validate
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_and_print_nothing_that_is_not_theirs(path, tmp_path):
    import nbformat  # 2 s
    from nbclient import NotebookClient

    notebook = nbformat.read(path, 4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs for cell in cells)
    NotebookClient(
        notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    printed = [
        one for cell in cells for one in cell.outputs if one.output_type == "stream"
    ]
    assert all(one.name == "stdout" and "aichi" not in one.text for one in printed)
    assert any(
        "image/png" in one.get("data", {}) for cell in cells for one in cell.outputs
    )
