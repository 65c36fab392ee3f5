# Copyright 2026 The slip_detector maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The chain's filter network as second-order sections: design, response, and how long it settles.

The chain assumes that the input was constant before its first row. Where the input was not, as
after a gap during a slip, the first results respond to that error and not to the signal, until the
chain has settled.
"""

import functools
import math

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.stages import floor_steps_db
from slip_detector.parameters import ChainConfig

Array = NDArray[np.float64]

#: Largest relative error of the designed gain at an edge; a design with a larger one is refused.
EDGE_TOLERANCE = 1e-3

#: Largest allowed bound of the gain's relative error from rounding the coefficients to float64.
#: The actual error is about a tenth of the bound. Narrow bands at low edges exceed it.
LARGEST_ROUND_OFF = 3e-6

#: Least distance of a pole from the unit circle: in float64 a closer pole cannot be distinguished
#: from an unstable one.
STABILITY_MARGIN = 1e-9

#: Filters have settled when their step response is below this share of its peak.
SETTLED = 0.01

#: Lower limit of the offset in the time that evidence takes to fall, which bounds that time.
LEAST_OFFSET_DB = 0.5

#: How far, in noise alone, the first envelope may be above the level where the floor settles. A
#: floor that is not learnt begins at the first envelope.
FIRST_FLOOR_DB = 5.0


def design(config: ChainConfig) -> Array:
    """Design the whole network: band-pass (Eq. 1-2), then each stop-band (Eq. 4).

    The filters are designed as second-order sections: in the polynomials of the same filters,
    round-off destroys the poles at low edges.

    Parameters
    ----------
    config
        The parameters of the chain; their gain goes into the first section.

    Returns
    -------
    ndarray, shape (sections, 6)
        Rows b0, b1, b2, 1, a1, a2, as in SciPy.

    Raises
    ------
    ValueError
        When a filter is unstable or has a wrong gain at its edges; names the edges.

    Examples
    --------
    >>> design(ChainConfig()).shape
    (6, 6)
    """
    rate_hz, degree = config.sample_rate_hz, config.stopband_degree
    ripple_db = config.stopband_ripple_db, config.stopband_attenuation_db
    filters = [_filter('passband_hz', rate_hz, config.passband_hz, config.passband_degree)]
    for edges_hz in config.stopbands_hz:
        filters.append(_filter('stopbands_hz', rate_hz, edges_hz, degree, *ripple_db))
    sections = np.concatenate(filters)
    sections[0, :3] *= config.gain
    return sections


def design_low(config: ChainConfig) -> Array:
    """Design the band-pass of the low level, of degree 4; without one there are no sections.

    Examples
    --------
    >>> design_low(ChainConfig()).shape
    (0, 6)
    """
    if not config.low_band_hz:
        return np.zeros((0, 6))
    low = _filter('activity_band_hz', config.sample_rate_hz, config.low_band_hz, 4)
    # SciPy has the two zeros at 0 Hz in one section, and those at half the rate in the other.
    return np.hstack([np.outer([low[0, 0], 1.0], [1.0, 0.0, -1.0]), low[:, 3:]])


@functools.lru_cache(maxsize=256)
def _filter(
    name: str, rate_hz: float, edges_hz: tuple[float, ...], degree: int, *ripple_db: float
) -> Array:
    """Design a band-pass, or a stop-band with ripple and attenuation.

    A design that is lost to round-off is refused.
    """
    # A late import: it takes longer than loading everything else that a node needs.
    from scipy import signal

    form = {'output': 'sos', 'fs': rate_hz}
    if ripple_db:
        sections = signal.ellip(degree // 2, *ripple_db, edges_hz, 'bandstop', **form)
        # By SciPy's definition the passband of an elliptic filter ends where the ripple does.
        gain = 10 ** (-ripple_db[0] / 20)
    else:
        edges_hz, band = (edges_hz, 'bandpass') if edges_hz[1] else (edges_hz[:1], 'highpass')
        sections = signal.butter(degree // len(edges_hz), np.squeeze(edges_hz), band, **form)
        # At the edges of a Butterworth filter the power is halved.
        gain = np.sqrt(0.5)
    radius = largest_pole_radius(sections)
    designed = np.abs(signal.sosfreqz(sections, np.array(edges_hz), fs=rate_hz)[1])
    is_off = not np.all(np.abs(designed - gain) <= EDGE_TOLERANCE * gain)
    if radius > 1 - STABILITY_MARGIN or is_off or round_off(sections) > LARGEST_ROUND_OFF:
        edges = ' and '.join(f'{edge:g}' for edge in edges_hz)
        raise ValueError(
            f'parameter {name}: the filter with edges at {edges} Hz is lost to round-off at '
            f'{rate_hz:g} Hz (largest pole radius {radius:.9f}), allowed: edges further apart and '
            f'between {1e-3 * rate_hz:g} and {0.49 * rate_hz:g} Hz, or a lower degree'
        )
    return np.asarray(sections)


def largest_pole_radius(sections: Array) -> float:
    """Return the distance of the outermost pole from the origin: below 1 for a stable filter.

    Examples
    --------
    >>> round(largest_pole_radius(design(ChainConfig())), 3)
    0.993
    """
    return float(max(np.abs(np.roots(section[3:])).max() for section in sections))


def round_off(sections: Array) -> float:
    """Return a bound of the gain's relative error that rounding the denominators causes.

    The error is largest where a denominator is smallest: on the unit circle next to a pole.

    Examples
    --------
    >>> bool(round_off(design(ChainConfig())) < LARGEST_ROUND_OFF)
    True
    """
    worst = 0.0
    for _, _, _, *denominator in sections:
        poles = np.roots(denominator)
        nearest = np.exp(1j * np.angle(poles))
        smallest = np.abs(np.prod(nearest[:, None] - poles, axis=1)).min()
        worst = max(worst, np.finfo(np.float64).eps * np.abs(denominator).sum() / smallest)
    return worst


def settling_rows(config: ChainConfig) -> int:
    """Return the number of rows in which filters, windows, evidence and floors settle.

    After these rows the response of the filters to a step at the first row has fallen below
    :data:`SETTLED` of its peak, and larger values have left the windows. The response begins after
    the rows of the mains comb, in which its output is 0. Evidence has fallen from its limit, and a
    floor that is not learnt by :data:`FIRST_FLOOR_DB`, unless the rate of floors is 0.

    Raises
    ------
    ValueError
        When a filter of the configuration cannot be run in float64.

    Examples
    --------
    >>> settling_rows(ChainConfig())  # 0.43 s: 134 for the filters, 15 for each window
    164
    >>> evidence = ChainConfig(decision='evidence', noise_floor=1e-3, noise_floor_learnt=True)
    >>> settling_rows(evidence)  # 134, 15 for the envelope, 141 for the evidence
    290
    """
    rows = config.mains_rows + _filter_rows(design(config))
    if config.low_band_hz:
        rows = max(rows, _filter_rows(design_low(config)))
    rows += config.samples(config.envelope_window_s)
    if config.decision == 'mean':
        return rows + config.samples(config.decision_window_s)
    floor_rows = 0
    _, down_db = floor_steps_db(config.noise_floor_rate_db_s, config.sample_rate_hz)
    if down_db and not (config.noise_floor_learnt and config.floors):
        most_db = config.noise_floor_range_db if config.floors else FIRST_FLOOR_DB
        floor_rows = math.ceil(min(FIRST_FLOOR_DB, most_db) / down_db)
    return rows + max(config.samples(evidence_falls_s(config)), floor_rows)


def evidence_falls_s(config: ChainConfig) -> float:
    """Return the time, in seconds, in which evidence falls from its limit to 0 in noise alone.

    Examples
    --------
    >>> config = ChainConfig(decision='evidence', noise_floor=1e-3, evidence_offset_db=2.6)
    >>> evidence_falls_s(config)
    0.5
    """
    return config.evidence_limit_db_s / max(config.evidence_offset_db, LEAST_OFFSET_DB)


def _filter_rows(sections: Array) -> int:
    from scipy import signal

    rows = 256
    while True:
        size = np.abs(signal.sosfilt(sections, np.ones(rows)))
        last = int(np.flatnonzero(size > SETTLED * size.max())[-1])
        # The response has settled if it stays small for as long as it took to become small.
        if last < rows // 2:
            return last + 1
        rows *= 2
