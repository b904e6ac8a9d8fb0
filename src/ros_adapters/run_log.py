"""What a run leaves for the judge and for the person who watches it: files, counters and the status line."""

import csv
import io
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from explore_3dnav.msg import Contact, ExplorationDecision, RunEvent
from nav_msgs.msg import Odometry
from numpy.typing import NDArray

from exploration_evaluation import format_summary, write_json
from exploration_evaluation.ending import judged_at_end, why_not
from exploration_evaluation.run_files import mapped_sweeps
from exploration_evaluation.verdict import Fault, succeeded_alone
from mount_calibration import RECORDED_FILE, TiltCalibration, write_calibration
from rigid_geometry import clock_leap_s, quat_xyzw_from_transform
from robot_body import DESCRIPTION, RobotBody, robot_mapping
from ros_adapters.conversions import plain, stamp_of, transform_from_pose
from ros_adapters.diagnostics import status_name
from ros_adapters.mapping_mode import OFF
from whole_files import WaitingLines, refusal, write_whole

VERSION = "0.1.0"
_COUNTED = ("pose_graph_mapping_node", "octomap_server_3dnav_node")
_MAP_FILES = ("map.bt", "trajectory.txt", "cloud.ply")

_KEPT = tuple(
    f"_{name}"
    for name in "started begun last_stamp_s elapsed_s first_wall_s event decision counts distance_m last_xy runtime changes".split()
)


class RunLog:
    """Collects counters from messages; without a folder it only keeps the status line."""

    def __init__(
        self,
        out: Path | None,
        parameters: dict[str, object],
        robot: RobotBody,
        calibration: TiltCalibration | None = None,
        *,
        judged: bool,
        memory: Mapping[str, object] | None = None,
    ) -> None:
        """`calibration`: that of the mount, which the nodes apply; `judged`: there is a true world to judge the run by.

        `memory`: of a log that goes on here, in the same folder.
        """
        self.finished = False
        self._judged = judged
        self._out = out
        self._parameters = {**parameters, "robot": robot_mapping(robot)}
        self._started, self._begun = time.time(), time.monotonic()
        self._last_stamp_s: float | None = None
        self._elapsed_s = 0.0
        self._first_wall_s = self._started
        self._event = RunEvent(state="starting")
        self._decision: ExplorationDecision | None = None
        self._counts: dict[str, str] = {}
        self._runtime: dict[str, dict[str, object]] = {}  # by node
        self._changes: list[dict[str, object]] = []
        self._distance_m = 0.0
        self._last_xy: NDArray[np.float64] | None = None
        self.__dict__.update(memory or {})
        self._not_written: dict[str, str] = {}  # by file
        self._truth_file = self._contacts_file = self._events_file = None
        if out and judged:
            self._truth_file = WaitingLines(out / "trajectory_truth.txt", goes_on=memory is not None)
            has_contacts = memory is not None or (self._own.get("resume") is True and (out / "contacts.csv").is_file())
            self._contacts_file = WaitingLines(out / "contacts.csv", goes_on=has_contacts)
            self._contacts_file.add("" if has_contacts else "stamp,link,speed_mps,force_n,other\n")
        if out:
            self._events_file = WaitingLines(out / "events.csv", goes_on=memory is not None)
        if memory is None:
            self._begin(out, robot, calibration)

    def _begin(self, out: Path | None, robot: RobotBody, calibration: TiltCalibration | None) -> None:
        """What the folder has from the beginning."""
        if out and self._events_file:
            self._events_file.add("stamp_s,wall_s,state,reason,sweeps\n")
            self._write("run.json", partial(write_json, value=self._run_description()))
            self._write("robot.yaml", partial(write_whole, content=yaml.safe_dump(robot_mapping(robot), sort_keys=False)))
            if description := self._parameters.get("robot_description"):
                self._write(DESCRIPTION, partial(write_whole, content=str(description)))
            if calibration is None or calibration.is_nominal:
                self._write(RECORDED_FILE, partial(Path.unlink, missing_ok=True))  # of an earlier run
            else:
                self._write(RECORDED_FILE, partial(write_calibration, calibration))

    def _write(self, name: str, write: Callable[[Path], object]) -> None:
        """A file of the folder. A disk that does not take it stops nobody, and is told."""
        assert self._out is not None
        self._not_written.pop(name, None)
        try:
            write(self._out / name)
        except OSError as error:
            self._not_written[name] = refusal(error, self._out / name)

    @property
    def not_written(self) -> str:
        """Which file the disk did not take, and why, of all the first; empty when all is on disk."""
        lines = (file.problem for file in (self._truth_file, self._contacts_file, self._events_file) if file)
        return next((text for text in (*lines, *self._not_written.values()) if text), "")

    def memory(self) -> dict[str, object]:
        """What a log that goes on needs beside the folder."""
        return {name: self.__dict__[name] for name in _KEPT}

    @property
    def _own(self) -> dict[str, object]:
        section = self._parameters.get("exploration_monitor_node")
        return section if isinstance(section, dict) else {}

    def _run_description(self) -> dict[str, Any]:
        config = {k: v for k, v in self._parameters.items() if k.endswith("_node") or k == "robot"}
        started = time.strftime("%Y-%m-%dT%H:%M:%S", time.localtime(self._started))
        told = {key: self._own.get(key) for key in (("world", "seed", "profile") if self._judged else ("profile",))}
        told["sensor"] = self._parameters.get("sensor")
        told["mapping"] = self._parameters.get("mapping", "stop_and_go")
        return {**told, "started": started, "version": VERSION, "config": config, "parameter_changes": self._changes}

    @property
    def sim_time_s(self) -> float:
        """Seconds of the stamps' time since the first odometry; a clock that is set anew counts for nothing."""
        return self._elapsed_s

    @property
    def _maps(self) -> bool:
        return self._parameters.get("mapping") != OFF

    def _is_over(self, stamp_s: float) -> bool:
        """Whether something comes after the run: the clock goes on until all nodes have ended, how far depends on the machine."""
        return self.finished or (self._has_ended and stamp_s > stamp_of(self._event) + 1e-6)

    @property
    def _has_ended(self) -> bool:
        """By what the robot says: what it does afterwards is no part of the run."""
        return self._event.state in ("finished", "failed")

    def truth(self, stamp_s: float, T_world_base: NDArray[np.float64]) -> None:
        if self._truth_file and not self._is_over(stamp_s):
            numbers = (*T_world_base[:3, 3], *quat_xyzw_from_transform(T_world_base))
            self._truth_file.add(f"{stamp_s:.3f} " + " ".join(f"{v:.6f}" for v in numbers) + "\n")

    def contact(self, message: Contact) -> None:
        if self._contacts_file and not self._is_over(stamp_of(message)):
            numbers = f"{message.speed_mps:.4f},{message.force_n:.2f}"
            self._contacts_file.add(f"{stamp_of(message):.3f},{message.link},{numbers},{message.other}\n")

    def event(self, message: RunEvent) -> None:
        is_known = (message.state, message.header.stamp) == (self._event.state, self._event.header.stamp)  # latched, and heard again
        if self.finished or self._has_ended or is_known:
            return
        self._event = plain(message, RunEvent)
        if self._events_file:
            row = (f"{stamp_of(message):.3f}", f"{time.monotonic() - self._begun:.3f}", message.state, message.reason, message.sweeps)
            line = io.StringIO()
            csv.writer(line, lineterminator="\n").writerow(row)
            self._events_file.add(line.getvalue())

    def decision(self, message: ExplorationDecision) -> None:
        self._decision = plain(message, ExplorationDecision)

    def diagnostics(self, message: DiagnosticArray) -> None:
        counted = [status_name(node) for node in _COUNTED]
        for status in message.status:
            if status.name in counted:
                self._counts.update({v.key: v.value for v in status.values})

    def knows_parameters_of(self, node: str) -> bool:
        """Whether a node has told of its parameters."""
        return node in self._runtime

    def parameters_of(self, node: str, values: dict[str, object]) -> None:
        """What a node says of its parameters; what is not as it was before goes to run.json, with the time of the newest odometry."""
        before = self._runtime.setdefault(node, values)
        self._runtime[node] = values
        at = {"stamp_s": self._last_stamp_s, "node": node}
        new = [{**at, "parameter": name, "before": before.get(name), "value": v} for name, v in values.items() if before.get(name) != v]
        self._changes += new
        if self._out and new and not self.finished:
            self._write("run.json", partial(write_json, value=self._run_description()))

    def odometry(self, message: Odometry) -> None:
        stamp_s, xy = stamp_of(message), transform_from_pose(message.pose.pose)[:2, 3]
        if self._is_over(stamp_s):
            return
        leapt_s = clock_leap_s(self._last_stamp_s, stamp_s)
        if self._last_stamp_s is None:
            self._first_wall_s = time.time()
        else:
            self._elapsed_s += stamp_s - self._last_stamp_s - leapt_s
        self._last_stamp_s = stamp_s
        if self._last_xy is not None and leapt_s >= 0.0:  # set back, the clock begins the odometry anew
            self._distance_m += float(np.linalg.norm(xy - self._last_xy))
        self._last_xy = xy

    def status_line(self) -> str:
        wall_s = time.time() - self._first_wall_s
        factor = f" x{self.sim_time_s / wall_s:.1f}" if self.sim_time_s > 1 and wall_s > 1 else ""
        d = self._decision
        known = f", {self._counts.get('ground m2', '?')} m2 of ground, {d.open_frontiers} frontiers open" if d else ""
        doing = self._event.state + (f": {self._event.reason}" if self._event.reason else "")
        return f"t={self.sim_time_s:.1f} s{factor}, {self._event.sweeps} sweeps, {self._distance_m:.0f} m{known} | {doing}"

    def wait_for_maps(self, timeout_s: float) -> None:
        """Until the mapping and terrain nodes have written their maps, or the time is over; of a finished map nothing is written."""
        if not self._maps:
            return
        deadline = time.monotonic() + timeout_s
        while self._out and time.monotonic() < deadline:
            if all((self._out / name).exists() and (self._out / name).stat().st_mtime > self._started for name in _MAP_FILES):
                return
            time.sleep(0.1)

    def _counters(self, reason: str, restarts: Mapping[str, int]) -> dict[str, Any]:
        d = self._decision
        return {
            "stop_reason": reason,
            "sim_time_s": round(self.sim_time_s, 3),
            "wall_time_s": round(time.time() - self._first_wall_s, 3),
            **({} if self._maps else {"sweeps": self._event.sweeps}),  # of a map whoever judges the run knows better
            "loop_closures": int(self._counts.get("loop closures", 0)),
            "refused_matches": int(self._counts.get("refused matches", 0)),
            "local_classifications": d.local_classifications if d else 0,
            "local_classification_time_s": d.local_classification_time_s if d else 0.0,
            "global_classifications": d.global_classifications if d else 0,
            "global_classification_time_s": d.global_classification_time_s if d else 0.0,
            "set_aside_frontiers": d.set_aside_frontiers if d else 0,
            "restarts": dict(restarts),
        }

    def finish(
        self,
        reason: str,
        *,
        judge: bool = True,
        restarts: Mapping[str, int] | None = None,
        not_saved: Sequence[str] = (),
        memory_mb: Mapping[str, Mapping[str, float]] | None = None,
    ) -> str:
        """Writes the counters, has the run judged where there is a true world and `judge` says so; the text for the terminal.

        `restarts`: how often each node was started again, of those that were. `not_saved`: what other nodes could not save.
        `memory_mb`: peak and end of each node.
        """
        counters = {**self._counters(reason, restarts or {}), "memory_mb": {**(memory_mb or {})}}
        if not self._out:
            return f"ended: {reason}"
        for file in (self._truth_file, self._contacts_file, self._events_file):
            if file:
                file.close()
        not_on_disk = [*(not_saved if self._maps else []), *([self.not_written] if self.not_written else [])]
        counters["not_on_disk"] = not_on_disk
        self._write("counters.json", partial(write_json, value=counters))
        return "\n".join((self._told(reason, counters, judge=judge), *(f"not on disk: {text}" for text in not_on_disk)))

    def _told(self, reason: str, counters: Mapping[str, Any], *, judge: bool) -> str:
        """The verdict, as text."""
        assert self._out is not None
        if self._judged:
            return judged_at_end(self._out) if judge else f"ended: {reason}"
        summary = self._own_summary(self._out, counters)
        from exploration_evaluation.pictures import draw_pictures  # matplotlib takes a second to load

        try:
            draw_pictures(self._out, summary)
        except (ValueError, OSError) as error:
            return f"{format_summary(summary)}\nno pictures: {why_not(error, self._out)}"
        return format_summary(summary)

    def _own_summary(self, out: Path, counters: Mapping[str, Any]) -> dict[str, Any]:
        """What a robot knows of its run by itself; the distance is its odometry's."""
        known, reason = {**self._run_description(), **counters, "distance_m": round(self._distance_m, 3)}, counters["stop_reason"]
        known["success"] = succeeded_alone(reason, self._distance_m, known["set_aside_frontiers"])
        if self._maps:
            known["sweeps"] = _mapped_sweeps(out)
        known["faults"] = [] if known["success"] else [str(Fault.STAYED if reason.startswith("explored") else Fault.NOT_EXPLORED)]
        if known["not_on_disk"]:
            known["success"], known["faults"] = False, [*known["faults"], str(Fault.NOT_ON_DISK)]
        self._write("summary.json", partial(write_json, value=known))
        return known


def _mapped_sweeps(out: Path) -> int | None:
    """None where none was mapped, or not on disk."""
    try:
        return mapped_sweeps(out)
    except ValueError:
        return None
