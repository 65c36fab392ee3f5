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

"""How fast the chain is, against rivals that are measured in the same run.

:func:`measure_chain_speed` gives one object (keys of ``python -m benchmarks chain --json``):

``blocks``
    All stages on blocks of rows of 16 channels, from volts to decisions: ``ns_per_row`` of each
    side. With all rows in one call the sides are ``chain``, ``kept`` (the
    chain with envelope and level kept) and ``numpy`` (SciPy and NumPy, an expression for each
    stage); in pieces ``chain_in_pieces``, ``kept_in_pieces``, ``median_in_pieces`` (with the
    median as common mode), ``evidence_in_pieces`` (the same filters with comb, floors and
    impacts) and ``contact_in_pieces`` (as many filters, and evidence with contact and activity).
    From these follow ``speedup`` (against ``numpy``), and as multiples of the run time of
    decisions alone ``kept_ratio``, ``whole_kept_ratio`` (in one call), ``median_ratio`` and
    ``evidence_ratio``, of that of evidence ``contact_ratio``. ``agreement`` is the share of equal
    decisions of ``numpy``.
``one_row``
    One row per call against one bare ``scipy.signal.sosfilt``: ``chain_us_per_call``,
    ``sosfilt_us_per_call``, ``speedup``.
"""

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import signal

from benchmarks.chain.rivals import NumpyChain
from benchmarks.measurement import least_times_s, swelling_noise_v
from slip_detector.chain.filters import design
from slip_detector.chain.samples import Floats
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.compiled import COMPILED
from slip_detector.parameters import ChainConfig

#: Rounding differs between the sides, so a level next to the threshold may be above it for
#: one and below it for the other; with less agreement than this there is a fault.
LEAST_AGREEMENT = 1 - 1e-5

#: NumPy is fastest with about this many rows in a call: the arrays of the call fit into the
#: second-level cache, and the call itself takes little of its time.
ROWS_PER_CALL = 4096

#: The default filters and all stages of the evidence: comb, floors and impacts.
ALL_OF_EVIDENCE = ChainConfig(
    decision='evidence', noise_floor=(1e-6,), mains_hz=50.0, impact_v=1.0
)
WITH_CONTACT = dataclasses.replace(
    ALL_OF_EVIDENCE, passband_hz=(20.0, 50.0), contact_level_v=1e-3, activity_cap_db=8.7
)


def measure_chain_speed(quick: bool = False) -> dict[str, Any]:
    """Measure the chain; the keys are in the module's docstring.

    Raises
    ------
    RuntimeError
        When the chain and its rival decide differently.
    """
    rows, calls, rounds = (20_000, 200, 3) if quick else (200_000, 500, 20)
    if not COMPILED:  # The chain takes some 500 times as long.
        rows, calls, rounds = 2_000, 20, 2
    return {
        'blocks': measure_blocks(rows, rounds),
        'one_row': measure_one_row(calls, 3 * rounds),
    }


def measure_blocks(n_rows: int, rounds: int) -> dict[str, Any]:
    """Measure all stages on rows of 16 channels, from volts to decisions."""
    config = ChainConfig()
    rows = swelling_noise_v(n_rows, config.channels)
    pieces = [rows[i : i + ROWS_PER_CALL] for i in range(0, len(rows), ROWS_PER_CALL)]
    chain, median = SlipChain(config), SlipChain(ChainConfig(common_mode='median'))
    evidence, contact = SlipChain(ALL_OF_EVIDENCE), SlipChain(WITH_CONTACT)
    plain = NumpyChain(config, rows[0])
    mine = chain.update(rows)
    ours = np.hstack([mine.slip[:, None], mine.groups, mine.channels])
    agreement = float((ours == plain.update(rows)).mean())
    if agreement < LEAST_AGREEMENT:
        raise RuntimeError(f'the chain and its rival agree on {agreement:%} of the decisions')

    def turn(
        update: Callable[..., object], parts: list[Floats], **kept: bool
    ) -> Callable[[], None]:
        def run() -> None:
            for part in parts:
                update(part, **kept)

        return run

    bare = {'envelope': False, 'level': False}
    sides = {
        'chain': turn(chain.update, [rows], **bare),
        'kept': turn(chain.update, [rows]),
        'numpy': turn(plain.update, [rows]),
        'chain_in_pieces': turn(chain.update, pieces, **bare),
        'kept_in_pieces': turn(chain.update, pieces),
        'median_in_pieces': turn(median.update, pieces, **bare),
        'evidence_in_pieces': turn(evidence.update, pieces, **bare),
        'contact_in_pieces': turn(contact.update, pieces, **bare),
    }
    times_s = least_times_s(list(sides.values()), rounds, time.thread_time)
    ns = {name: s / len(rows) * 1e9 for name, s in zip(sides, times_s, strict=True)}
    in_pieces = ns['chain_in_pieces']
    return {
        'agreement': agreement,
        'ns_per_row': ns,
        'speedup': ns['numpy'] / ns['chain'],
        'kept_ratio': ns['kept_in_pieces'] / in_pieces,
        'whole_kept_ratio': ns['kept'] / ns['chain'],
        'median_ratio': ns['median_in_pieces'] / in_pieces,
        'evidence_ratio': ns['evidence_in_pieces'] / in_pieces,
        'contact_ratio': ns['contact_in_pieces'] / ns['evidence_in_pieces'],
    }


def measure_one_row(calls: int, rounds: int) -> dict[str, Any]:
    """Compare one row per call with one bare call of sosfilt on the same row."""
    config = ChainConfig()
    block = swelling_noise_v(calls, config.channels)
    rows = [block[i : i + 1] for i in range(len(block))]
    chain, sections = SlipChain(config), design(config)
    delays = signal.sosfilt_zi(sections)[:, :, None] * rows[0]

    def chain_calls() -> None:
        for row in rows:
            chain.update(row)

    def sosfilt_calls() -> None:
        zi = delays
        for row in rows:
            _, zi = signal.sosfilt(sections, row, axis=0, zi=zi)

    sides = [chain_calls, sosfilt_calls]
    chain_s, sosfilt_s = least_times_s(sides, rounds, time.thread_time)
    return {
        'chain_us_per_call': chain_s / calls * 1e6,
        'sosfilt_us_per_call': sosfilt_s / calls * 1e6,
        'speedup': sosfilt_s / chain_s,
    }
