"""The doctor looks at this machine without falling ill itself, and names the remedy for what is missing."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from taichi_disk import doctor
from taichi_disk.cli import main
from taichi_disk.doctor import Finding, print_findings

MISSING = "ModuleNotFoundError: No module named '{}'"


def test_a_crash_a_hang_and_an_error_of_a_probe_are_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    assert doctor._probe("print('noise'); print('fine')") == (True, "fine")
    assert doctor._probe("raise SystemExit('no driver')") == (False, "no driver")
    assert doctor._probe("import nothing_at_all") == (False, MISSING.format("nothing_at_all"))
    assert doctor._probe("import os; os.kill(os.getpid(), 11)") == (False, "crashed (SIGSEGV)")
    monkeypatch.setattr(doctor, "PROBE_SECONDS", 0.2)
    assert doctor._probe("import time; time.sleep(60)") == (False, "no answer within 0.2 s")


def test_a_missing_x11_library_is_told_from_a_missing_taichi(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = "ImportError: libX11.so.6: cannot open shared object file: No such file or directory"
    monkeypatch.setattr(doctor, "_probe", lambda code: (False, missing))
    assert doctor._taichi().mend == ("apt-get update && apt-get install -y --no-install-recommends libx11-6")
    monkeypatch.setattr(doctor, "_probe", lambda code: (False, MISSING.format("taichi")))
    assert doctor._taichi().mend == "pip install taichi==1.7.4"


@pytest.mark.parametrize(
    ("version", "ok"), [((3, 9, 18), False), ((3, 10, 0), True), ((3, 13, 9), True), ((3, 14, 0), False)]
)
def test_python_is_checked_against_the_range_that_taichi_supports(
    monkeypatch: pytest.MonkeyPatch, version: tuple[int, int, int], ok: bool
) -> None:
    class Version(tuple[int, int, int]):
        major, minor, micro = version

    monkeypatch.setattr(sys, "version_info", Version(version))
    assert doctor._python().ok is ok


def test_a_cache_folder_with_a_file_in_the_way_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TI_OFFLINE_CACHE_FILE_PATH", str(tmp_path / "new" / "cache"))
    assert doctor._cache().ok
    (tmp_path / "new").write_text("")
    assert not doctor._cache().ok


def test_what_is_missing_is_listed_with_its_remedy_and_decides_the_exit_status(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    good = Finding("Taichi", True, "1.7.4", "unneeded remedy")
    optional = Finding("CUDA", False, "no CUDA device", needed=False)
    missing = Finding("Vulkan", False, "no driver [at all]", "apt-get install it")
    monkeypatch.setattr(doctor, "examine", lambda: [good, optional])
    assert main(["doctor"]) == 0
    text = capsys.readouterr().out
    assert "Ready" in text and "unneeded remedy" not in text
    monkeypatch.setattr(doctor, "examine", lambda: [good, optional, missing])
    assert main(["doctor"]) == 1
    text = capsys.readouterr().out
    assert "Vulkan:\n    apt-get install it\n" in text
    assert "no driver [at all]" in text
    assert text.endswith("Not ready: Vulkan\n")


def test_the_examination_answers_every_question_and_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    findings = doctor.examine()
    assert list(tmp_path.iterdir()) == []
    assert all(one.found for one in findings)
    by_name = {one.name: one for one in findings}
    # The tests themselves need these two.
    assert by_name["Python"].ok and by_name["Taichi on the CPU"].ok
    assert by_name["Taichi on the CPU"].found == "1.7.4"
    assert all(one.mend for one in findings if one.needed)
    print_findings(findings)
