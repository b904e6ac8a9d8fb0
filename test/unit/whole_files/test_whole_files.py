"""Files that are whole or not there, and lines that wait, on disks that take nothing: `ulimit -f` and /dev/full stand for them."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from whole_files import RefusedError, WaitingLines, refusal, remove_unfinished, write_all, write_whole, written_whole

BIG = b"x" * 20_000


def test_file_is_replaced_by_bytes_or_text(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_whole(path, b"old")
    write_whole(path, "neu: ü\n")
    assert path.read_text(encoding="utf-8") == "neu: ü\n" and list(tmp_path.iterdir()) == [path]


def test_disk_that_takes_half_leaves_the_old_file_and_nothing_beside_it(tmp_path: Path, files_of_at_most) -> None:
    path = tmp_path / "a.bin"
    write_whole(path, b"old")
    with files_of_at_most(8192), pytest.raises(RefusedError) as caught:
        write_whole(path, BIG)
    assert str(caught.value) == f"{path}: files here may not be so large: raise `ulimit -f`" == refusal(caught.value, tmp_path)
    assert caught.value.errno == errno.EFBIG
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


def test_crash_while_replacing_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "graph.g2o"
    write_whole(path, b"old")

    def refuse(*_: object) -> None:
        raise OSError("no")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OSError, match="no"):
        write_whole(path, b"new")
    assert path.read_bytes() == b"old" and os.listdir(tmp_path) == ["graph.g2o"]


def test_library_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError), written_whole(path) as unfinished:
        unfinished.write_bytes(b"half")
        raise RuntimeError
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


def test_what_a_killed_program_left_is_removed(tmp_path: Path) -> None:
    (tmp_path / ".part.map.bt").write_bytes(BIG)
    (tmp_path / "map.bt").write_bytes(b"kept")
    remove_unfinished(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["map.bt"]


def test_lines_wait_for_the_disk_and_come_in_order(tmp_path: Path, files_of_at_most) -> None:
    lines, written = WaitingLines(tmp_path / "log"), [f"line {k} of many, each as long as the others\n" for k in range(600)]
    with files_of_at_most(8192):
        for text in written[:400]:
            lines.add(text)
        assert "ulimit -f" in lines.problem
        assert (tmp_path / "log").stat().st_size <= 8192
    for text in written[400:]:
        lines.add(text)
    assert not lines.problem
    assert (tmp_path / "log").read_text() == "".join(written)


def test_lines_of_a_full_disk_stop_nobody(tmp_path: Path) -> None:
    (tmp_path / "log").symlink_to("/dev/full")
    lines = WaitingLines(tmp_path / "log")
    lines.add("one\n")
    lines.close()
    assert f"{tmp_path / 'log'}: the disk /" in lines.problem and "is full: make room there" in lines.problem


def test_lines_begin_when_there_is_a_folder(tmp_path: Path) -> None:
    lines = WaitingLines(tmp_path / "there" / "log")
    lines.add("one\n")
    assert lines.problem
    (tmp_path / "there").mkdir()
    lines.add("two\n")
    assert (tmp_path / "there" / "log").read_text() == "one\ntwo\n" and not lines.problem


def test_lines_begin_anew_or_go_on_after_the_last_whole_one(tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_text("one\nhalf of tw")
    WaitingLines(path, goes_on=True).add("three\n")
    assert path.read_text() == "one\nthree\n"
    WaitingLines(path).add("new\n")
    assert path.read_text() == "new\n"


@pytest.mark.parametrize(
    ("code", "advice"),
    [
        (errno.ENOSPC, "is full: make room there"),
        (errno.EROFS, "is read-only: mount it for writing"),
        (errno.EMFILE, "raise `ulimit -n`"),
        (errno.EACCES, "Permission denied"),
    ],
)
def test_refusal_names_the_file_and_what_to_do_in_one_line(code: int, advice: str, tmp_path: Path) -> None:
    text = refusal(OSError(code, os.strerror(code)), tmp_path / "not there yet" / "map.bt")
    assert text.startswith(str(tmp_path / "not there yet" / "map.bt")) and advice in text and "\n" not in text


@pytest.mark.parametrize("code", [0, 3])
def test_words_on_a_full_disk_end_nobody(code: int, tmp_path: Path) -> None:
    body = (
        "import logging, sys; from whole_files import words_end_nobody; words_end_nobody()\n"
        "logging.getLogger().addHandler(logging.FileHandler('/dev/full'))\n"
        "for _ in range(3): print('x' * 9000, flush=True); sys.stderr.write('y'); logging.error('z')\n"
        f"open(sys.argv[1], 'w').write('lived'); sys.exit({code})"
    )
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-c", body, str(tmp_path / "log")]
        path = os.pathsep.join(p for p in sys.path if p)
        done = subprocess.run(command, stdout=full, stderr=full, env={**os.environ, "PYTHONPATH": path}, check=False)
    assert (done.returncode, (tmp_path / "log").read_text()) == (code, "lived")


def test_several_files_are_replaced_all_or_none(tmp_path: Path, files_of_at_most) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    write_all({a: b"old a", b: b"old b"})
    assert (a.read_bytes(), b.read_bytes()) == (b"old a", b"old b")
    with files_of_at_most(8192), pytest.raises(RefusedError, match=str(b)):
        write_all({a: b"new a", b: BIG})
    assert (a.read_bytes(), b.read_bytes()) == (b"old a", b"old b") and sorted(tmp_path.iterdir()) == [a, b]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_does_not_part_several_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals) -> None:
    heard: list[int] = []

    def hear(number: int, _frame: object) -> None:
        heard.append(number)

    replace = os.replace

    def interrupted(source: Path, target: Path) -> None:
        os.kill(os.getpid(), number)
        replace(source, target)

    signal.signal(number, hear)
    monkeypatch.setattr(os, "replace", interrupted)
    write_all({tmp_path / name: b"new" for name in "ab"})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
    assert heard == [] and signal.getsignal(number) is hear
