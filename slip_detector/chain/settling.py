"""How long a chain settles after it was started or reset.

Before its first row it takes the input to have been constant. Where it was not, as after a gap in
the midst of a slip, the first rows are answered by what began there and not by what is there.
"""

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.chain.filters import design
from slip_detector.parameters.detector import ChainConfig

#: Filters have settled where their response to a step is below this share of its peak.
SETTLED = 0.01

#: For so many rows the response is computed at first.
SHORTEST = 256


def settling_rows(config: ChainConfig) -> int:
    """Return for how many rows filters and windows settle.

    After so many rows the response of the filters to a step at the first row has fallen below
    :data:`SETTLED` of its peak, and what was above it has left the windows.

    Raises
    ------
    ValueError
        When a filter of the configuration cannot be run in float64.

    Examples
    --------
    >>> settling_rows(ChainConfig())  # 0.43 s: 134 for the filters, 15 for each window
    164
    >>> settling_rows(ChainConfig(stopbands_hz=()))
    94
    """
    windows = config.samples(config.envelope_window_s) + config.samples(config.decision_window_s)
    return _filter_rows(design(config)) + windows


def _filter_rows(sections: NDArray[np.float64]) -> int:
    step = np.empty(SHORTEST)
    while True:
        _step_response(sections, step)
        size = np.abs(step)
        last = int(np.flatnonzero(size > SETTLED * size.max())[-1])
        # What stays small for as long as it took to become so has settled.
        if last < step.size // 2:
            return last + 1
        step = np.empty(2 * step.size)


@compiled
def _step_response(sections, output):  # type: ignore[no-untyped-def]
    """Write the response of filters, shape (s, 6), to a step from 0 to 1 at the first row."""
    output[:] = 1.0
    for s in range(sections.shape[0]):
        b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
        a1, a2 = sections[s, 4], sections[s, 5]
        first = second = 0.0
        for k in range(output.size):
            value = output[k]
            output[k] = b0 * value + first
            first = b1 * value - a1 * output[k] + second
            second = b2 * value - a2 * output[k]
