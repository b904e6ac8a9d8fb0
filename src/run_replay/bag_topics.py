"""What of a recorded bag is shown: topics that rviz knows are passed on, the map is built again from the sweeps."""

from pathlib import Path

SWEEPS = "/mapped_sweep"
BUILT_FROM_SWEEPS = frozenset({"/cloud_map", "/trajectory", "/pose_graph", "/terrain_markers", "/occupied_cells_vis_array"})
PASSED_ON = frozenset({"/tf", "/tf_static", "/joint_states", "/scan_horizontal", "/plan"})
LATCHED = BUILT_FROM_SWEEPS | {"/tf_static"}


def shown_topics(recorded: frozenset[str]) -> frozenset[str]:
    """The recorded topics that are read; with the sweeps there, what is built from them is not taken from the bag, too."""
    others: frozenset[str] = frozenset() if SWEEPS in recorded else BUILT_FROM_SWEEPS
    return recorded & (PASSED_ON | others | {SWEEPS})


def bag_problem(path: Path) -> str | None:
    """Why a bag cannot be shown, in one line, or None; only its index is read."""
    from rosbags.rosbag1 import Reader, ReaderError

    try:
        with Reader(path) as bag:
            recorded = frozenset(bag.topics)
    except (ReaderError, OSError, ValueError) as error:
        return f"this bag cannot be read: {' '.join(str(error).split())}"
    if not shown_topics(recorded):
        return f"this bag has nothing to show: none of {', '.join(sorted({SWEEPS} | PASSED_ON | BUILT_FROM_SWEEPS))}"
    return None
