"""The pages are true: Python blocks run, commands are accepted (those of blocks marked
```sh no-run are parsed and checked, never run), links lead somewhere."""

import re
import shlex
from inspect import signature
from pathlib import Path

import pytest
from programs import command, printed_by

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
]
PAGES_WITH_CODE = ("tutorial", "api", "bodies", "extending", "colours", "taichi")
BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?:`|^ {4})taichi-disk ([^`\n]+)", re.MULTILINE)
LINK = re.compile(r"\[[^]\n]*\]\(([^)\s]+)\)")
TABLE = re.compile(r"^\|.*\n\|[-| ]+\|\n((?:\|.*\n)+)\nData:((?:.+\n)+)", re.MULTILINE)
SHOWN = re.compile(r"(?<![\w.])[+−-]?\d[\d,]*(?:\.\d+)?(?![\w.]*\w)")
WRITTEN = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]\d+)?")

every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def blocks(page, language):
    """Yield (remark, text) of each block in a language."""
    return (
        (remark.strip(), text)
        for kind, remark, text in BLOCK.findall(page.read_text("utf-8"))
        if kind == language
    )


def prose(page):
    return BLOCK.sub("", page.read_text("utf-8"))


def commands(page):
    """Yield (whether it may run, arguments) of each command in blocks and lines."""
    for text in INLINE.findall(prose(page)):
        words = shlex.split(text, comments=True)
        # only the name of a command
        yield False, words if len(words) > 1 else [*words, "--help"]
    for remark, text in blocks(page, "sh"):
        for line in text.replace("\\\n", " ").splitlines():
            for part in re.split(r"&&|\|\||;", line.split(" #")[0]):
                words = shlex.split(
                    part.replace("$SLURM_ARRAY_TASK_ID", "3").replace("$HOME", "."),
                    comments=True,
                )
                if words and words[0].rpartition("/")[2] == "taichi-disk":
                    yield remark != "no-run", words[1:]


@pytest.mark.validate
@pytest.mark.parametrize(
    "name", ["README", *(f"docs/{page}" for page in PAGES_WITH_CODE)]
)
def test_python_blocks_run_from_top_to_bottom(name, tmp_path):
    page = ROOT / f"{name}.md"
    code = "\n".join(text for _, text in blocks(page, "python"))
    if not code:
        pytest.skip("no code")
    script = tmp_path / "page.py"  # Taichi reads the source of kernels from a file
    script.write_text(code, encoding="utf-8")
    printed_by(script, cwd=tmp_path)


def lay_out(page, folder):
    """Put into `folder` what the commands of a page read."""
    for name in ("docs", "scenes"):
        (folder / name).symlink_to(ROOT / name)
    for _, text in blocks(page, "xml"):
        (folder / "five.svg").write_text(text)


@every_page
def test_commands_are_accepted(page, tmp_path, monkeypatch):
    from taichi_disk.cli import _parser
    from taichi_disk.experiments.scenes import check_feasible, load_any, shipped_scenes

    lay_out(page, tmp_path)
    monkeypatch.chdir(tmp_path)
    for _, words in commands(page):
        try:
            arguments = _parser().parse_args(words)
        except SystemExit as end:  # 0 after --help
            assert end.code == 0, f"taichi-disk {shlex.join(words)}"
            continue
        scene = getattr(arguments, "scene", None) or ""
        if scene in shipped_scenes() or Path(scene).is_file():
            check_feasible(load_any(scene, arguments.overrides))


@pytest.mark.validate
@every_page
def test_commands_run(page, tmp_path):
    lay_out(page, tmp_path)
    for may_run, words in commands(page):
        # these need a display
        if may_run and words and words[0] not in ("view", "doctor"):
            scene = words[1] if len(words) > 1 else ""
            if scene.endswith(".yaml") and not (tmp_path / scene).exists():
                continue  # a file that the reader makes
            ended = command(*words, cwd=tmp_path)
            assert ended.returncode == 0, f"{shlex.join(words)}\n{ended.stderr[-2000:]}"


@every_page
def test_links_resolve(page):
    for target in LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.exists(), target
        if anchor and path.suffix == ".md":
            headings = re.findall(r"^#+ (.*)$", prose(path), re.MULTILINE)
            assert anchor in [
                re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")
                for heading in headings
            ]


@every_page
def test_python_files_that_a_page_names_exist(page):
    if page.name == "changelog.md":  # of versions before, too
        return
    known = [*ROOT.glob("taichi_disk/**/*.py"), *ROOT.glob("tests/**/*.py")]
    known += ROOT.glob("docs/*/*.py")
    paths = [f"/{path.relative_to(ROOT)}" for path in known]
    for name in re.findall(r"(?<![\w./])[a-z_]+(?:/[a-z_]+)*\.py\b", page.read_text()):
        assert any(path.endswith(f"/{name}") for path in paths), name


@pytest.mark.parametrize("name", ["results.md", "stability.md"])
def test_every_number_of_a_table_is_in_the_data_named_below_it(name):
    page = ROOT / "docs" / name
    found = TABLE.findall(page.read_text("utf-8"))
    assert found
    for rows, below in found:
        files = re.findall(r"\((data/[^)]*)\)", below)
        written = " ".join((page.parent / file).read_text("utf-8") for file in files)
        values = [float(number) for number in WRITTEN.findall(written)]
        # equations, links, names
        for text in SHOWN.findall(re.sub(r"\([1-6]\)|\]\([^)]*\)|`[^`]*`", " ", rows)):
            digits = text.replace("−", "-").replace(",", "")
            # a whole number is exact
            decimals = len(digits.partition(".")[2])
            half = 0.5 * 10.0**-decimals if decimals else 0.0
            most = half * (1 + 1e-6) + 1e-12
            near = any(abs(value - float(digits)) <= most for value in values)
            assert near, f"{text} is not in {files}"


def test_the_docstrings_of_the_reference_say_what_every_argument_is():
    from taichi_disk import Lattice, Result, load_scene, run, run_sweep
    from taichi_disk.mechanics.fields import field

    names = ("state", "trajectory", "field", "export", "film", "save", "load")
    methods = [getattr(Result, name) for name in names]
    functions = (load_scene, run, run_sweep, field, Lattice.disk, Lattice.from_points)
    for function in (*functions, *methods):
        for name in signature(function).parameters.keys() - {"self", "cls"}:
            is_described = re.search(rf"\b{name}: |`{name}`", function.__doc__)
            assert is_described, f"{function.__qualname__}: {name}"


@pytest.mark.validate
def test_integrators_give_what_the_page_on_numerics_says():
    from taichi_disk import load_scene, run

    row = (
        r"^\| (\d+) \| `(\w+)` \| ([\d,]+) \| ([\d.]+) \|"
        r" ([\d.]+)·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+) \|$"
    )
    found = re.findall(
        row, (ROOT / "docs/numerics.md").read_text("utf-8"), re.MULTILINE
    )
    assert len(found) == 6
    plain = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    for eta_star, integrator, steps, e, part, power in found:
        estimate = float(f"{part}e{power.translate(plain)}")
        keys = [f"material.eta_star={eta_star}", f"time.integrator={integrator}"]
        result = run(load_scene("exponential_wall", keys), lattices=1)
        assert result.summary["steps"] == int(steps.replace(",", ""))
        digit = 10.0 ** -len(e.partition(".")[2])
        assert result.restitution == pytest.approx(float(e), abs=0.6 * digit)
        assert result.error == pytest.approx(estimate, rel=0.03)
