"""The doctor looks at this machine without falling ill itself, and names the remedy for what is missing."""

from __future__ import annotations

from taichi_disk import doctor
from taichi_disk.cli import main
from taichi_disk.doctor import Finding, examine, probe


def test_a_crash_a_hang_and_an_error_of_a_probe_are_answers(monkeypatch):
    assert probe("print('noise'); print('fine')") == (True, "fine")
    assert probe("raise SystemExit('no driver')") == (False, "no driver")
    assert probe("import nothing_at_all") == (False, "ModuleNotFoundError: No module named 'nothing_at_all'")
    assert probe("import os; os.kill(os.getpid(), 11)") == (False, "crashed (SIGSEGV)")
    monkeypatch.setattr(doctor, "PROBE_SECONDS", 0.2)
    assert probe("import time; time.sleep(60)") == (False, "no answer within 0.2 s")


def test_a_missing_x11_library_and_a_cache_in_the_way_of_a_file_are_told_with_their_remedies(tmp_path, monkeypatch):
    missing = "ImportError: libX11.so.6: cannot open shared object file: No such file or directory"
    monkeypatch.setattr(doctor, "probe", lambda code: (False, missing))
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("TI_OFFLINE_CACHE_FILE_PATH", str(tmp_path / "file" / "cache"))
    found = {one.name: one for one in examine()}
    assert found["Taichi on the CPU"].mend == "apt-get update && apt-get install -y --no-install-recommends libx11-6"
    assert not found["cache of kernels"].ok and str(tmp_path) in found["cache of kernels"].found


def test_what_is_missing_is_listed_with_its_remedy_and_decides_the_exit_status(monkeypatch, capsys):
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


def test_the_examination_answers_every_question_and_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    findings = {one.name: one for one in examine()}
    assert list(tmp_path.iterdir()) == []
    assert all(one.found for one in findings.values())
    assert findings["Taichi on the CPU"].found == "1.7.4"  # the tests themselves need it
    assert all(one.mend for one in findings.values() if one.needed)
