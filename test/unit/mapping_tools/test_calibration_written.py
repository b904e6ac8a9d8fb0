"""./calibrate_mount --from writes over nothing that it reads, and says so before it works; its help is there after --from, too."""

from pathlib import Path

import pytest
import yaml

from mapping_tools import calibrate_mount
from robot_body import RobotBody, robot_mapping
from whole_files import write_whole


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A file that is no bag: who opens it says so, and it is not to be opened."""
    write_whole(tmp_path / "robot.yaml", yaml.safe_dump(robot_mapping(RobotBody()), sort_keys=False))
    write_whole(tmp_path / "run.bag", "what was recorded")
    return tmp_path / "run.bag"


def refusal(capsys: pytest.CaptureFixture[str], recording: Path, out: Path) -> str:
    assert calibrate_mount.main(["--from", str(recording), "--out", str(out)]) == 2
    text = capsys.readouterr().err
    assert text.startswith("./calibrate_mount: ") and text.count("\n") == 1
    return text


def test_output_that_is_read_is_refused_by_whatever_path(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = recording.parent
    (folder / "link.yaml").symlink_to(recording)
    (folder / "hard.yaml").hardlink_to(recording)
    for out in (recording, folder / ".." / folder.name / "run.bag", folder / "link.yaml", folder / "hard.yaml", folder / "robot.yaml"):
        for read in (recording, folder):
            text = refusal(capsys, read, out)
            assert f"--out {out}: is " in text and "which is only read" in text
    assert recording.read_text() == "what was recorded" and "only read" not in refusal(capsys, recording, folder / "mount.yaml")


def test_output_that_is_a_folder_is_refused_before_the_bag_is_read(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "is a folder" in refusal(capsys, recording, recording.parent)


def test_output_that_cannot_be_written_is_refused_before_the_bag_is_read(
    recording: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = recording.parent / "new" / "mount.yaml"
    assert "not a rosbag" in refusal(capsys, recording, out)  # the folder would be made
    assert f"{recording} is a file, expected a folder" in refusal(capsys, recording, recording / "mount.yaml")
    monkeypatch.setattr("whole_files.outputs.os.access", lambda *_: False)
    assert f"{recording.parent} may not be written to" in refusal(capsys, recording, out)


def test_help_stands_behind_from_as_well(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--from", "--help"], ["--from", "run.bag", "--help"], ["-h"]):
        with pytest.raises(SystemExit) as ended:
            calibrate_mount.main(words)
        assert ended.value.code == 0 and capsys.readouterr().out.startswith("usage: ./calibrate_mount --from BAG|FOLDER")
