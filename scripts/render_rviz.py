#!/usr/bin/env python3
"""Takes pictures of rviz on a real run, with no display: Xvfb, ./explore, rviz with config/explore.rviz, all three ended afterwards.

    python scripts/render_rviz.py --world ramp --seed 1 --sweeps 80 --view -3.3 -10.4 0 30 2.8 0.85        makes docs/rviz.png

With --sweeps the picture is taken on the drive after so many, and the run ended there; else when the run has ended: rviz outlives it and
keeps what it was shown last. Frames are taken on the way. --view looks at a point of the map from a distance (m), yaw and pitch (rad)
instead of following the robot. Needs Debian's rviz, xvfb and imagemagick. Exit code 1 when one is missing, the run
failed or rviz died.
"""

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
SOFTWARE_GL = {"LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1"}
TOOLS = ("rviz", "Xvfb", "import", "convert")
SETTLE_S = 10.0  # software rendering needs seconds for a frame of a whole map ..
UNDER_WAY_S = 4.0  # .. and the robot drives on meanwhile
FRAME_RATE_HZ = 1  # more would take the cores from the run
BORDERS = {"north": "0x62", "south": "0x30", "east": "16x0"}  # menu and tools, status line, handle of the hidden right dock
DRIVING_AFTER = re.compile(r" (\d+) sweeps.*\| driving")
MASTER = re.compile(r"ROS_MASTER_URI=(\S+)")


@contextmanager
def ended(process: "subprocess.Popen[Any]") -> Iterator["subprocess.Popen[Any]"]:
    """`process`, which is told to end, and killed when it has not after a while, however the block is left."""
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(60.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextmanager
def virtual_display(width: int, height: int) -> Iterator[str]:
    """The name of a new X display of this size."""
    read_end, write_end = os.pipe()
    command = ["Xvfb", "-displayfd", str(write_end), "-screen", "0", f"{width}x{height}x24", "-nolisten", "tcp"]
    with ended(subprocess.Popen(command, pass_fds=(write_end,), stderr=subprocess.DEVNULL)):
        os.close(write_end)
        with os.fdopen(read_end) as number:
            yield f":{number.readline().strip()}"


def rviz_config(width: int, height: int, view: list[float] | None) -> str:
    """config/explore.rviz for a window of this size, with `view` (x y z distance yaw pitch in map) where there is one."""
    config = yaml.safe_load((ROOT / "config" / "explore.rviz").read_text(encoding="utf-8"))
    config["Visualization Manager"]["Global Options"]["Frame Rate"] = FRAME_RATE_HZ
    config["Window Geometry"].update({"Width": width, "Height": height, "X": 0, "Y": 0})
    if view:
        x, y, z, distance, yaw, pitch = view
        current = config["Visualization Manager"]["Views"]["Current"]
        current.update({"Target Frame": "map", "Focal Point": {"X": x, "Y": y, "Z": z}, "Distance": distance, "Yaw": yaw, "Pitch": pitch})
    return str(yaml.safe_dump(config))


def start_rviz(config: Path, display: str, scale: int, master: str) -> "subprocess.Popen[bytes]":
    """rviz on a display and a master, in the shell environment that ./explore sets up; `scale` pixels for each of the window's."""
    script = f"root={shlex.quote(str(ROOT))}; source scripts/setup.bash; exec rviz -d {shlex.quote(str(config))}"
    environment = dict(os.environ, DISPLAY=display, ROS_MASTER_URI=master, QT_SCALE_FACTOR=str(scale), **SOFTWARE_GL)
    return subprocess.Popen(["bash", "-c", script], cwd=ROOT, env=environment)


def start_explore(arguments: argparse.Namespace, out: str) -> "subprocess.Popen[str]":
    command = ["./explore", "--headless", "--world", arguments.world, "--seed", str(arguments.seed), "--out", out, "--force"]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)


def master_of(explore: "subprocess.Popen[str]") -> str:
    """The master that ./explore names in its first lines; RuntimeError when it ends before."""
    assert explore.stdout is not None
    for line in explore.stdout:
        print(line, end="", flush=True)
        found = MASTER.search(line)
        if found:
            return found.group(1)
    raise RuntimeError("./explore ended before it named its ROS master")


def screenshot(display: str, target: Path) -> None:
    subprocess.run(["import", "-display", display, "-window", "root", str(target)], check=True)


def watch(explore: "subprocess.Popen[str]", display: str, frames: Path | None, every_s: float, sweeps: int | None) -> bool:
    """Prints the run's lines and takes a frame every `every_s`; True on the drive after `sweeps`, False at the end of the run."""
    assert explore.stdout is not None
    due, count = time.monotonic() + every_s, 0
    for line in explore.stdout:
        print(line, end="", flush=True)
        driving = DRIVING_AFTER.search(line)
        if sweeps is not None and driving and int(driving.group(1)) >= sweeps:
            return True
        if frames and time.monotonic() >= due:
            screenshot(display, frames / f"rviz_{count:03d}.png")
            due, count = time.monotonic() + every_s, count + 1
    return False


def finish_picture(raw: Path, target: Path, scale: int, width: int) -> None:
    """Cuts off the window's borders, shrinks the screenshot to `width`, which smooths it, and writes it with 256 colours."""
    command = ["convert", str(raw)]
    for side, pixels in BORDERS.items():
        chop = "x".join(str(scale * int(n)) for n in pixels.split("x"))
        command += ["-gravity", side, "-chop", chop]
    command += ["-resize", f"{width}x", "+dither", "-colors", "256", "-strip", "-define", "png:compression-level=9", f"PNG8:{target}"]
    subprocess.run(command, check=True)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Takes pictures of rviz on a run of ./explore, without a display.")
    parser.add_argument("--world", default="ramp")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", default="", help="folder of the run; default: a temporary one")
    parser.add_argument("--picture", type=Path, default=ROOT / "docs" / "rviz.png", help="where the last picture goes")
    parser.add_argument("--sweeps", type=int, metavar="N", help="take the picture on the drive after N sweeps, and end the run")
    parser.add_argument("--frames", type=Path, help="folder for pictures on the way")
    parser.add_argument("--every", type=float, default=5.0, metavar="S", help="seconds between two frames")
    parser.add_argument("--size", type=int, nargs=2, default=(1440, 900), metavar=("W", "H"), help="of the window, pixels")
    parser.add_argument("--scale", type=int, default=2, help="pixels of the screen for each of the window's; 2 smooths the picture")
    parser.add_argument("--width", type=int, default=1280, help="of the picture, pixels")
    parser.add_argument("--view", type=float, nargs=6, metavar=("X", "Y", "Z", "DISTANCE", "YAW", "PITCH"))
    return parser.parse_args()


def main() -> int:
    arguments = parsed()
    if missing := [name for name in TOOLS if shutil.which(name) is None]:
        print(f"not installed: {', '.join(missing)}; needs Debian's rviz, xvfb and imagemagick", file=sys.stderr)
        return 1
    width, height = arguments.size
    scale = arguments.scale
    if arguments.frames:
        arguments.frames.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, virtual_display(scale * width, scale * height) as display:
        config, last = Path(folder) / "view.rviz", Path(folder) / "last.png"
        config.write_text(rviz_config(width, height, arguments.view), encoding="utf-8")
        with ended(start_explore(arguments, arguments.out or f"{folder}/run")) as explore:
            with ended(start_rviz(config, display, scale, master_of(explore))) as rviz:
                under_way = watch(explore, display, arguments.frames, arguments.every, arguments.sweeps)
                time.sleep(UNDER_WAY_S if under_way else SETTLE_S)
                if rviz.poll() is not None:
                    print(f"rviz ended with {rviz.returncode}", file=sys.stderr)
                    return 1
                screenshot(display, last)
                finish_picture(last, arguments.picture, scale, arguments.width)
            return 0 if under_way else explore.wait()


if __name__ == "__main__":
    sys.exit(main())
