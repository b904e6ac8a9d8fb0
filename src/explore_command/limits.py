"""What the system lets a run have: too few file handles, or too little memory, are told before anything starts."""

import resource

LEAST_FILES = 256  # exploration_monitor_node has 80 open, rviz some more
LEAST_ADDRESSES_GB = 4.0  # pybullet_sim_node and exploration_monitor_node reserve 2.7 in rooms, and use a sixth of it


def limits_problem() -> str | None:
    """What is too little, and what to do, in one line, or None. As many file handles as the system allows are taken."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if _is_less(soft, LEAST_FILES) and not _is_less(hard, LEAST_FILES):
        resource.setrlimit(resource.RLIMIT_NOFILE, (LEAST_FILES, hard))
    elif _is_less(soft, LEAST_FILES):
        return f"a process may open {soft} files here, and some nodes need {LEAST_FILES}: raise `ulimit -n`"
    addresses = resource.getrlimit(resource.RLIMIT_AS)[0]
    if _is_less(addresses, LEAST_ADDRESSES_GB * 1e9):
        gb = f"{addresses / 1e9:.1f} GB"
        return f"a process may have {gb} of addresses here, and some nodes reserve {LEAST_ADDRESSES_GB:.0f} GB: raise `ulimit -v`"
    return None


def _is_less(limit: int, least: float) -> bool:
    return limit != resource.RLIM_INFINITY and limit < least
