"""Who is connected to whom, as rospy knows it of this process."""

import rospy


def heard_publishers(subscriber: rospy.Subscriber) -> set[str]:
    """Names of the nodes from which messages arrive by now.

    rospy counts a connection before it has called the publisher; only the answer to its handshake gives the publisher's name.
    """
    return {c.callerid_pub for c in subscriber.impl.connections} - {"unknown"}


def is_heard(subscriber: rospy.Subscriber) -> bool:
    """Whether messages arrive from anybody."""
    return bool(heard_publishers(subscriber))
