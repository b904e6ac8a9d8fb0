"""The barrier on the simulator's side: which answers and commands let the next tick begin."""

import pytest

from ros_adapters.tick_answers import TickAnswers

TOPICS = ["/cmd_vel"]


def test_tick_holds_when_it_was_answered_and_its_commands_have_come():
    answers = TickAnswers()
    assert not answers.holds(1)
    answers.add_answer(1, TOPICS, [2])
    answers.add_command(0.1, 0.0)
    assert not answers.holds(1)
    answers.add_command(0.2, 0.0)
    assert answers.holds(1) and not answers.holds(2)


def test_tick_without_a_command_holds_when_it_was_answered():
    answers = TickAnswers()
    answers.add_answer(1, TOPICS, [0])
    assert answers.holds(1) and answers.take_command() is None


def test_newest_command_is_taken_once():
    answers = TickAnswers()
    answers.add_command(0.1, 0.0)
    answers.add_command(0.3, -0.2)
    assert answers.take_command() == (0.3, -0.2) and answers.take_command() is None


def test_answers_may_come_late_and_in_any_order():
    answers = TickAnswers()
    answers.add_command(0.0, 0.0)
    answers.add_command(0.0, 0.0)
    answers.add_answer(3, TOPICS, [2])
    answers.add_answer(2, TOPICS, [1])
    assert answers.holds(3)


def test_other_topics_may_be_counted_too():
    answers = TickAnswers()
    answers.add_answer(1, ["/odom", "/cmd_vel"], [20, 0])
    assert answers.holds(1)


@pytest.mark.parametrize(("topics", "counts"), [([], []), (["/odom"], [3]), (["/cmd_vel"], [])])
def test_answer_that_says_nothing_of_commands_is_refused(topics, counts):
    with pytest.raises(ValueError, match="answer to tick 4 counts"):
        TickAnswers().add_answer(4, topics, counts)


def test_recount_is_answered_by_who_has_heard_of_it_and_counts_from_his_commands():
    answers = TickAnswers()
    for _ in range(9):
        answers.add_command(0.1, 0.0)
    answers.add_answer(3, TOPICS, [9])
    assert answers.holds(3) and not answers.holds(3, 1)
    answers.add_answer(3, TOPICS, [1], 1)
    assert answers.holds(3, 1)
    answers.add_answer(4, TOPICS, [2], 1)
    assert not answers.holds(4, 1)
    answers.add_command(0.2, 0.0)
    assert answers.holds(4, 1)
    answers.add_answer(5, TOPICS, [11])  # of a process that is gone
    assert not answers.holds(5, 1)
