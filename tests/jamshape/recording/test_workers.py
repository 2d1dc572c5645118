"""Processes that work for another one."""

import pytest

from jamshape.recording.workers import Workers


def test_all_tasks_are_done_by_any_number_of_workers():
    for jobs in (1, 3, 20):
        with Workers("math:sqrt", [(k * k,) for k in range(7)], jobs) as workers:
            assert sorted((done.number, done.result) for done in workers) == [
                (k, k) for k in range(7)
            ]


def test_an_expected_error_is_a_reason():
    with Workers("math:sqrt", [(4,), (-1,), (9,)], 1) as workers:
        found = {done.number: done for done in workers}
    assert (found[0].result, found[2].result) == (2.0, 3.0)
    assert found[1].failure == "math domain error"


def test_a_process_that_ends_fails_its_task_alone():
    with Workers("os:_exit", [(3,), (4,)], 1) as workers:
        assert [done.failure for done in workers] == [
            "its process ended with exit code 3",
            "its process ended with exit code 4",
        ]


def test_an_error_that_nobody_expects_is_raised_with_its_trace():
    with Workers("math:sqrt", [("four",)], 1) as workers, pytest.raises(TypeError) as error:
        list(workers)
    assert "Traceback" in error.value.__notes__[0]


def test_what_tasks_print_does_not_disturb_their_results(capfd):
    with Workers("os:system", [("echo printed",)], 1) as workers:
        assert [done.result for done in workers] == [0]
    assert "printed" in capfd.readouterr().err


def test_workers_end_while_they_work():
    with Workers("time:sleep", [(600,)] * 2, 2) as workers:
        assert workers.wait(0.5) is None
        processes = list(workers._processes)
    assert all(process.wait(10) for process in processes)
