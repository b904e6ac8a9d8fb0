"""What a run leaves for the judge and for the person who watches it: files, counters and the status line."""

import csv
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from explore_3dnav.msg import Contact, ExplorationDecision, RunEvent
from nav_msgs.msg import Odometry
from numpy.typing import NDArray

from exploration_evaluation import format_summary, write_json
from exploration_evaluation.ending import judged_at_end
from exploration_evaluation.pictures import draw_pictures
from exploration_evaluation.verdict import Fault, succeeded_alone
from mount_calibration import RECORDED_FILE, TiltCalibration, write_calibration
from rigid_geometry import quat_xyzw_from_transform
from robot_body import DESCRIPTION, RobotBody, robot_mapping
from ros_adapters.conversions import plain, stamp_of, transform_from_pose
from ros_adapters.mapping_mode import OFF

VERSION = "0.1.0"
_COUNTED = ("pose_graph_mapping_node", "octomap_server_3dnav_node")
_MAP_FILES = ("map.bt", "trajectory.txt", "cloud.ply")

_KEPT = tuple(
    f"_{name}"
    for name in "started begun last_stamp_s elapsed_s first_wall_s event decision counts distance_m last_xy runtime changes".split()
)
_CLOCK_JUMP_S = 60.0  # no odometry is silent for so long: somebody set the clock


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
        mode = "w" if memory is None else "a"
        self._truth_file = self._contacts_file = self._events_file = None
        if out and judged:
            self._truth_file = (out / "trajectory_truth.txt").open(mode, buffering=1)
            self._contacts_file = (out / "contacts.csv").open(mode, buffering=1)
        if out:
            self._events_file = (out / "events.csv").open(mode, newline="", buffering=1)
        if memory is None:
            self._begin(out, robot, calibration)

    def _begin(self, out: Path | None, robot: RobotBody, calibration: TiltCalibration | None) -> None:
        """What the folder has from the beginning."""
        if self._contacts_file:
            self._contacts_file.write("stamp,link,speed_mps,force_n,other\n")
        if out and self._events_file:
            self._events_file.write("stamp_s,wall_s,state,reason,sweeps\n")
            write_json(out / "run.json", self._run_description())
            (out / "robot.yaml").write_text(yaml.safe_dump(robot_mapping(robot), sort_keys=False))
            if description := self._parameters.get("robot_description"):
                (out / DESCRIPTION).write_text(str(description))
            if calibration is None or calibration.is_nominal:
                (out / RECORDED_FILE).unlink(missing_ok=True)  # of an earlier run
            else:
                write_calibration(calibration, out / RECORDED_FILE)

    def memory(self) -> dict[str, object]:
        """What a log that goes on needs beside the folder."""
        return {name: self.__dict__[name] for name in _KEPT}

    def _run_description(self) -> dict[str, Any]:
        section = self._parameters.get("exploration_monitor_node")
        own = section if isinstance(section, dict) else {}
        config = {k: v for k, v in self._parameters.items() if k.endswith("_node") or k == "robot"}
        started = time.strftime("%Y-%m-%dT%H:%M:%S", time.localtime(self._started))
        told = {key: own.get(key) for key in (("world", "seed", "profile") if self._judged else ("profile",))}
        told["sensor"] = self._parameters.get("sensor")
        told["mapping"] = self._parameters.get("mapping", "stop_and_go")
        return {**told, "started": started, "version": VERSION, "config": config, "parameter_changes": self._changes}

    @property
    def sim_time_s(self) -> float:
        """Seconds of the stamps' time since the first odometry; a clock that is set anew counts for nothing."""
        return self._elapsed_s

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
            self._truth_file.write(f"{stamp_s:.3f} " + " ".join(f"{v:.6f}" for v in numbers) + "\n")

    def contact(self, message: Contact) -> None:
        if self._contacts_file and not self._is_over(stamp_of(message)):
            numbers = f"{message.speed_mps:.4f},{message.force_n:.2f}"
            self._contacts_file.write(f"{stamp_of(message):.3f},{message.link},{numbers},{message.other}\n")

    def event(self, message: RunEvent) -> None:
        is_known = (message.state, message.header.stamp) == (self._event.state, self._event.header.stamp)  # latched, and heard again
        if self.finished or self._has_ended or is_known:
            return
        self._event = plain(message, RunEvent)
        if self._events_file:
            row = (f"{stamp_of(message):.3f}", f"{time.monotonic() - self._begun:.3f}", message.state, message.reason, message.sweeps)
            csv.writer(self._events_file, lineterminator="\n").writerow(row)

    def decision(self, message: ExplorationDecision) -> None:
        self._decision = plain(message, ExplorationDecision)

    def diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name in _COUNTED:
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
            write_json(self._out / "run.json", self._run_description())

    def odometry(self, message: Odometry) -> None:
        stamp_s, xy = stamp_of(message), transform_from_pose(message.pose.pose)[:2, 3]
        if self._is_over(stamp_s):
            return
        if self._last_stamp_s is None:
            self._first_wall_s = time.time()
        elif 0.0 < stamp_s - self._last_stamp_s < _CLOCK_JUMP_S:
            self._elapsed_s += stamp_s - self._last_stamp_s
        self._last_stamp_s = stamp_s
        if self._last_xy is not None:
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
        if self._parameters.get("mapping") == OFF:
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
            "sweeps": self._event.sweeps,
            "loop_closures": int(self._counts.get("loop closures", 0)),
            "refused_matches": int(self._counts.get("refused matches", 0)),
            "local_classifications": d.local_classifications if d else 0,
            "local_classification_time_s": d.local_classification_time_s if d else 0.0,
            "global_classifications": d.global_classifications if d else 0,
            "global_classification_time_s": d.global_classification_time_s if d else 0.0,
            "set_aside_frontiers": d.set_aside_frontiers if d else 0,
            "restarts": dict(restarts),
        }

    def finish(self, reason: str, *, judge: bool = True, restarts: Mapping[str, int] | None = None) -> str:
        """Writes the counters, has the run judged where there is a true world and `judge` says so; the text for the terminal.

        `restarts`: how often each node was started again, of those that were.
        """
        counters = self._counters(reason, restarts or {})
        if not self._out:
            return f"ended: {reason}"
        for file in (self._truth_file, self._contacts_file, self._events_file):
            if file:
                file.close()
        write_json(self._out / "counters.json", counters)
        if self._judged:
            return judged_at_end(self._out) if judge else f"ended: {reason}"
        summary = self._own_summary(self._out, counters)
        try:
            draw_pictures(self._out, summary)
        except ValueError as error:
            return f"{format_summary(summary)}\nno pictures: {error}"
        return format_summary(summary)

    def _own_summary(self, out: Path, counters: Mapping[str, Any]) -> dict[str, Any]:
        """What a robot knows of its run by itself; the distance is its odometry's."""
        known, reason = {**self._run_description(), **counters, "distance_m": round(self._distance_m, 3)}, counters["stop_reason"]
        known["success"] = succeeded_alone(reason, self._distance_m, known["set_aside_frontiers"])
        known["faults"] = [] if known["success"] else [str(Fault.STAYED if reason.startswith("explored") else Fault.NOT_EXPLORED)]
        write_json(out / "summary.json", known)
        return known
