"""Results of sweeps take effect at their time, and a tick waits for the decision that is due."""

from ros_adapters.mapping_mode import CLOUD_WITHIN_S, RESULTS_AFTER_S, OpenSweeps, Results


def test_while_driving_in_lockstep_a_result_waits_for_its_time() -> None:
    taken: list[str] = []
    results = Results(lockstep=True, driving=True)
    results.add(10.0, lambda: taken.append("terrain"))
    results.add(10.0, lambda: taken.append("plan"))
    results.take_until(10.0 + RESULTS_AFTER_S - 0.05)
    assert not taken
    results.take_until(10.0 + RESULTS_AFTER_S)
    results.take_until(20.0)
    assert taken == ["terrain", "plan"]


def test_otherwise_at_once() -> None:
    for lockstep, driving in ((True, False), (False, True), (False, False)):
        taken: list[str] = []
        Results(lockstep=lockstep, driving=driving).add(10.0, lambda to=taken: to.append("terrain"))
        assert taken == ["terrain"]


def test_standing_a_tick_waits_for_the_decision_as_soon_as_a_cloud_is_out() -> None:
    sweeps = OpenSweeps(driving=False)
    sweeps.tick(1.0, 0)
    assert not sweeps.must_be_decided(1.0)
    sweeps.tick(1.05, 1)
    assert sweeps.must_be_decided(1.05)
    sweeps.decide()
    assert not sweeps.must_be_decided(1.05)


def test_driving_a_tick_waits_only_when_the_next_one_could_need_the_decision() -> None:
    sweeps, patience_s = OpenSweeps(driving=True), RESULTS_AFTER_S - CLOUD_WITHIN_S
    sweeps.tick(1.0, 1)
    assert not sweeps.must_be_decided(1.0 + patience_s - 0.05)
    assert sweeps.must_be_decided(1.0 + patience_s)


def test_decision_that_overtakes_the_tick_of_its_cloud_counts() -> None:
    sweeps = OpenSweeps(driving=False)
    sweeps.decide()
    sweeps.tick(1.0, 1)
    assert not sweeps.must_be_decided(1.0)
