"""One robot a ROS master: names of topics and parameters are those of the only robot, whatever namespace a node is in."""

import sys

import rospy


def refuse_namespace(node_name: str) -> None:
    """Ends a node of the exploring robot with exit code 2 when it is started in a namespace."""
    namespace = rospy.get_namespace()
    if namespace != "/":
        sys.stderr.write(
            f"{node_name}: started in the namespace {namespace.rstrip('/')}, and its topics are those of the only robot of a ROS master: "
            "give each robot a master of its own, by roslaunch -p PORT or ROS_MASTER_URI\n"
        )
        sys.exit(2)
