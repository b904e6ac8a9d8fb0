"""Publishers whose messages the barrier of lock-step counts."""

import rospy

from ros_adapters.aliases import ALIASES


class CountingPublisher(rospy.Publisher):
    """A publisher that knows how many messages it was given; while topics close at the end, what still comes goes nowhere.

    What has a second name in ALIASES is published under that, too; the messages count once.
    """

    sent = 0
    _alias: rospy.Publisher | None = None

    def __init__(self, name: str, data_class: type, **options: object) -> None:
        super().__init__(name, data_class, **options)
        if name in ALIASES:
            self._alias = rospy.Publisher(ALIASES[name], data_class, **options)

    def publish(self, *args: object, **fields: object) -> None:
        """Publishes, as rospy's."""
        try:
            super().publish(*args, **fields)
            if self._alias is not None:
                self._alias.publish(*args, **fields)
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():
                raise
        self.sent += 1

    def get_num_connections(self) -> int:
        """Listeners, by either name."""
        return int(super().get_num_connections()) + (self._alias.get_num_connections() if self._alias is not None else 0)
