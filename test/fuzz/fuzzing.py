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

import os
import re
import time

from hypothesis import HealthCheck, given, settings
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
