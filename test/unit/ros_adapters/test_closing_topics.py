"""What is published while the topics close at the end of a run goes nowhere; before that it is a fault."""

import pytest
import rospy

from ros_adapters.counting_publisher import CountingPublisher


@pytest.fixture
def publisher(monkeypatch: pytest.MonkeyPatch) -> CountingPublisher:
    def closed(self: object, *_: object, **__: object) -> None:
        raise rospy.ROSException("publish() to a closed topic")

    monkeypatch.setattr(rospy.Publisher, "publish", closed)
    return CountingPublisher.__new__(CountingPublisher)


def test_message_to_a_topic_that_closes_at_the_end_goes_nowhere(publisher: CountingPublisher, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: True)
    publisher.publish("message")
    assert publisher.sent == 1


def test_topic_that_is_closed_while_the_node_lives_is_a_fault(publisher: CountingPublisher, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: False)
    with pytest.raises(rospy.ROSException):
        publisher.publish("message")
