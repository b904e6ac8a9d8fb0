"""Results of sweeps take effect at their time, and a tick waits for the decision that is due."""

from ros_adapters.mapping_mode import OpenSweeps, Results, ResultTimes

TIMES = ResultTimes(after_s=0.6, cloud_within_s=0.25)


def test_while_driving_in_lockstep_a_result_waits_for_its_time() -> None:
    taken: list[str] = []
    results = Results(TIMES, lockstep=True, driving=True)
    results.add(10.0, lambda: taken.append("terrain"))
    results.add(10.0, lambda: taken.append("plan"))
    results.take_until(10.0 + TIMES.after_s - 0.05)
    assert not taken
    results.take_until(10.0 + TIMES.after_s)
    results.take_until(20.0)
    assert taken == ["terrain", "plan"]


def test_otherwise_at_once() -> None:
    for lockstep, driving in ((True, False), (False, True), (False, False)):
        taken: list[str] = []
        Results(TIMES, lockstep=lockstep, driving=driving).add(10.0, lambda to=taken: to.append("terrain"))
        assert taken == ["terrain"]


def test_standing_a_tick_waits_for_the_decision_as_soon_as_a_cloud_is_out() -> None:
    sweeps = OpenSweeps(TIMES, driving=False)
    sweeps.tick(1.0, 0)
    assert not sweeps.must_be_decided(1.0)
    sweeps.tick(1.05, 1)
    assert sweeps.must_be_decided(1.05)
    sweeps.decide(0.9)
    assert not sweeps.must_be_decided(1.05)


def test_driving_a_tick_waits_only_when_the_next_one_could_need_the_decision() -> None:
    sweeps, patience_s = OpenSweeps(TIMES, driving=True), TIMES.after_s - TIMES.cloud_within_s
    sweeps.tick(1.0, 1)
    assert not sweeps.must_be_decided(1.0 + patience_s - 0.05)
    assert sweeps.must_be_decided(1.0 + patience_s)


def test_decision_that_overtakes_the_tick_of_its_cloud_counts() -> None:
    sweeps = OpenSweeps(TIMES, driving=False)
    sweeps.decide(0.9)
    sweeps.tick(1.0, 1)
    assert not sweeps.must_be_decided(1.0)


def test_results_that_are_due_before_their_cloud_is_out_are_no_configuration() -> None:
    assert ResultTimes().validate() == []
    (problem,) = ResultTimes(after_s=0.3, cloud_within_s=0.3).validate()
    assert "cloud_within_s = 0.3 is not below after_s = 0.3" in problem
