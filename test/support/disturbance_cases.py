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

"""What the tests of the disturbances share: trials, instants, cuts, and generators that refuse."""

import re

import numpy as np
import pytest
from hypothesis import strategies as st

RATE_HZ = 380.0

#: Places to cut 228 rows (0.6 s) at, in any number.
CUTS = st.lists(st.integers(0, 60), max_size=12).map(lambda cuts: np.cumsum(cuts, dtype=int))


class RefusingGenerator(np.random.Generator):
    """A generator that draws nothing, and whose children do not either."""

    def __init__(self):
        super().__init__(np.random.PCG64(0))

    def _refuse(self, *args, **keywords):
        raise AssertionError('something was drawn')

    standard_normal = uniform = random = _refuse

    def spawn(self, n_children):
        return [RefusingGenerator() for _ in range(n_children)]


def trial(seed=0):
    return np.random.default_rng(seed)


def instants_s(duration_s, rate_hz=RATE_HZ):
    return np.arange(round(duration_s * rate_hz)) / rate_hz


def spectrum(values, rate_hz):
    """Return frequencies and amplitudes of a signal of whole seconds."""
    return np.fft.rfftfreq(len(values), 1 / rate_hz), 2 * np.abs(np.fft.rfft(values)) / len(values)


def check_closed_form(form, cuts, start_s):
    """Check that a function of time gives the same bits for any cut, and for instants alone."""
    t = start_s + instants_s(0.6)
    whole = form(t)
    pieces = [form(piece) for piece in np.split(t, cuts)]
    assert np.concatenate(pieces).tobytes() == whole.tobytes()
    for i in (0, 40, 130):
        np.testing.assert_array_equal(form(t[i]), whole[i])


def check_refused(part, parameters, said):
    """Check that parameters are refused in one line that begins with the part's name."""
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        part.from_parameters(parameters, 'part')
    assert str(caught.value).startswith('part: ')
    assert '\n' not in str(caught.value)
