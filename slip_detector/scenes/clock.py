"""The clock of the sensor."""

import dataclasses

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


@dataclasses.dataclass(frozen=True)
class Clock(ParameterSet):
    """A sensor whose clock does not run at its nominal rate.

    Examples
    --------
    >>> from slip_detector.scenes.clock import Clock
    >>> 380.0 * Clock(rate_ratio=1.01).rate_ratio  # samples in a second, of a sensor of 380 Hz
    383.8
    """

    rate_ratio: float = parameter(
        1.01, 'True rate of the samples over the nominal rate.', low=0.1, high=10.0
    )
