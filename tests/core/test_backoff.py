from sleepcast.core.backoff import Backoff


def test_pauses_double_up_to_the_longest() -> None:
    backoff = Backoff(0.5, 3.0)
    assert [backoff.take() for _ in range(5)] == [0.5, 1.0, 2.0, 3.0, 3.0]


def test_reset_begins_anew() -> None:
    backoff = Backoff(0.5, 3.0)
    backoff.take()
    backoff.reset()
    assert backoff.pause == backoff.take() == 0.5
