"""What a run was asked to do, by its run.json: whether to explore, and within which budget. For `run_folder`."""

from collections.abc import Mapping

from exploration_evaluation.run_files import JsonObject

_NODE = "octomap_server_3dnav_node"


def was_to_explore(reported: JsonObject) -> bool:
    """False for a robot that was only to drive to goals in a finished map."""
    return reported.get("mapping") != "off"


def budget_share(reported: JsonObject, distance_m: float | None) -> float | None:
    """What a run spent of its budget of time or way, whichever is more; None without one, or where nothing was reported."""
    spent = {"budget_s": reported.get("sim_time_s"), "budget_m": distance_m}
    limits = {name: _budget(reported, name) for name in spent}
    return max((float(cost) / limits[name] for name, cost in spent.items() if cost is not None and limits[name] > 0.0), default=None)


def _budget(reported: JsonObject, name: str) -> float:
    """As it was set last."""
    config: object = reported.get("config")
    for key in (_NODE, "exploration", name):
        config = config.get(key) if isinstance(config, Mapping) else None
    changes = reported.get("parameter_changes") or []
    newest = [c["value"] for c in changes if (c.get("node"), c.get("parameter")) == (_NODE, f"exploration_{name}")]
    value = newest[-1] if newest else config
    return float(value) if isinstance(value, (int, float)) else 0.0
