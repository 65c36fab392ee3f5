"""Times of things that take turns."""

from benchmarks.timing import least_times_s


def test_the_sides_take_turns():
    order = []
    times_s = least_times_s([lambda: order.append('a'), lambda: order.append('b')], 3)
    assert order == ['a', 'b'] * 4
    assert len(times_s) == 2
    assert all(0 <= time_s < 1 for time_s in times_s)


def test_the_time_is_that_of_the_clock():
    ticks = iter(range(100))
    times_s = least_times_s([lambda: None, lambda: next(ticks)], 2, clock=lambda: next(ticks))
    assert times_s == [1, 2]
