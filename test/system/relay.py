#!/usr/bin/env python3
"""relay.py FROM TO: passes messages on as they are, until it is stopped: what a sensor's driver is to the robot."""

import sys

import roslib.message
import rospy
from rospy.msg import AnyMsg


def main() -> None:
    source, target = rospy.myargv(sys.argv)[1:3]
    rospy.init_node("relay", anonymous=True, disable_rostime=True)
    publishers: dict[str, rospy.Publisher] = {}

    def pass_on(message: AnyMsg) -> None:
        kind = message._connection_header["type"]
        if kind not in publishers:
            publishers[kind] = rospy.Publisher(target, roslib.message.get_message_class(kind), queue_size=None, tcp_nodelay=True)
        publishers[kind].publish(message)

    rospy.Subscriber(source, AnyMsg, pass_on, queue_size=None, tcp_nodelay=True)
    rospy.spin()


if __name__ == "__main__":
    main()
