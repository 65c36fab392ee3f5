"""The clock: its ratio is checked; what it does is in the tests of the scene."""

import pytest

from slip_detector.scenes.clock import Clock
from support.disturbance_cases import check_refused


@pytest.mark.parametrize(('ratio', 'shown'), [(0, '0'), (0.09, '0.09'), (11, '11'), (-1.0, '-1')])
def test_a_ratio_that_is_not_allowed_is_named_with_what_is(ratio, shown):
    said = f'parameter rate_ratio is {shown}, allowed: 0.1 to 10'
    check_refused(Clock, {'rate_ratio': ratio}, said)


def test_parameters_survive_being_written_and_read():
    part = Clock(rate_ratio=0.97)
    assert type(part).from_parameters(part.to_parameters()) == part
