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

"""Damaged and hostile inputs: a few in each run of the tests, any number on request.

``make fuzz seconds=600`` tries each subject of ``test/fuzz`` for its share of that time, with new
inputs each time. What fails is shown as small as Hypothesis can make it, is kept in
``.hypothesis`` and tried first the next time; as a case in the corpus of its subject it stays.
"""

import dataclasses
import math
import os
import re
import time

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.database import DirectoryBasedExampleDatabase

#: Time for each subject, in seconds; 0: the corpus and a few inputs, the same in each run.
SECONDS = float(os.environ.get('SLIP_FUZZ_SECONDS', '0'))

#: Inputs at a time in a long run.
ROUND = 500

#: Longest line of a refusal: a value that makes it longer is a fault of the message.
MOST_CHARACTERS = 2000


def put(content, path):
    """Make a path a file of these bytes, or a link to another path."""
    path.unlink(missing_ok=True)
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path.symlink_to(content)


def fuzz(strategy, check, *, corpus, few, refusal=''):
    """Try the corpus of a subject, then inputs that a strategy draws.

    Parameters
    ----------
    strategy
        Hypothesis strategy of the inputs.
    check
        Takes an input, and asserts what holds for one that is taken. One that is refused is to
        raise a ValueError of one line.
    corpus
        Inputs that went wrong once.
    few
        Number of inputs in a short run.
    refusal
        Regular expression that each refusal matches.
    """

    def judge(case):
        try:
            check(case)
        except ValueError as error:
            line = str(error)
            assert line.splitlines() == [line], line
            assert len(line) <= MOST_CHARACTERS, line[:MOST_CHARACTERS]
            assert re.search(refusal, line), line

    for case in corpus:
        judge(case)
    ends_s = time.monotonic() + SECONDS
    how = settings(max_examples=few, suppress_health_check=list(HealthCheck))
    if SECONDS:
        kept = DirectoryBasedExampleDatabase('.hypothesis/fuzz')
        how = settings(how, max_examples=ROUND, derandomize=False, database=kept)
    one_round = how(given(strategy)(judge))
    one_round()
    while time.monotonic() < ends_s:
        one_round()


#: Values that hardly any parameter takes.
STRANGE = st.one_of(
    *(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5)),
    st.sampled_from(['٣', '1e400', 10**400, -(10**400), math.nan, math.inf, -0.0, 5e-324]),
    st.lists(st.one_of(st.integers(-2, 20), st.floats(), st.text(max_size=2)), max_size=4),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=2),
)


def near(field):
    """Draw values about which a parameter is taken or refused."""
    default = field.metadata['default']
    low, high = field.metadata['low'], field.metadata['high']
    bounds = [bound for bound in (low, high) if bound is not None]
    values = [default, *bounds, *(bound + 1 for bound in bounds), *(-bound for bound in bounds)]
    if isinstance(default, (int, float)) and not isinstance(default, bool):
        values += [0, 1, 2, default * 2, default / 3]
    return st.sampled_from([*values, *field.metadata['choices']])


@st.composite
def some_values(draw, parameters, most):
    """Draw values of some parameters of a set: mostly some that are taken, at times any."""
    fields = st.sampled_from(dataclasses.fields(parameters))
    chosen = draw(st.lists(fields, max_size=most, unique_by=id))
    strange = st.integers(0, 9)
    return {field.name: draw(near(field) if draw(strange) else STRANGE) for field in chosen}


@st.composite
def mutated_bytes(draw, originals, most=4):
    """Draw one of some bytes with a number of pieces changed, cut, doubled or inserted."""
    data = bytearray(draw(st.sampled_from(originals)))
    for _ in range(draw(st.integers(0, most))):
        begin = draw(st.integers(0, len(data)))
        end = begin + draw(st.sampled_from([0, 1, 2, 4, 8, 64, 1024, len(data)]))
        piece = bytes(data[begin:end])
        put = [b'', 2 * piece, *(bytes([value]) * len(piece) for value in (0, 1, 127, 128, 255))]
        put += [bytes([piece[0] ^ 1 << bit]) + piece[1:] for bit in range(8) if piece]
        data[begin:end] = draw(st.one_of(st.sampled_from(put), st.binary(max_size=16)))
    return bytes(data)


@st.composite
def mutated_text(draw, originals, pieces):
    """Draw one of some texts with up to four pieces removed, doubled or inserted."""
    text = draw(st.sampled_from(originals))
    for _ in range(draw(st.integers(0, 4))):
        begin = draw(st.integers(0, len(text)))
        end = min(len(text), begin + draw(st.sampled_from([0, 1, 3, 20])))
        put = draw(st.one_of(st.sampled_from(pieces), st.text(max_size=4)))
        text = text[:begin] + put + draw(st.sampled_from([text[begin:], text[end:]]))
    return text
