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

"""The chain on blocks of rows against its rivals, all in turns.

:func:`measure_blocks` gives the part ``blocks`` of :mod:`benchmarks.chain.speed`.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.chain.cpp_chain import CppChain, compiler_options, find_compiler
from benchmarks.chain.errors import ROWS_PER_CALL
from benchmarks.chain.numpy_chain import NumpyChain
from benchmarks.noise import swelling_noise_v
from benchmarks.timing import least_times_s
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Rounding differs between the sides, so a level next to the threshold may be above it for
#: one and below it for the other; with less agreement than this there is a fault.
LEAST_AGREEMENT = 1 - 1e-5


#: The default filters and all stages of the evidence: comb, floors and impacts.
ALL_OF_EVIDENCE = ChainConfig(
    decision='evidence', noise_floor=(1e-6,), mains_hz=50.0, impact_v=1.0
)


def measure_blocks(n_rows: int, rounds: int) -> dict[str, Any]:
    """Measure all stages on rows of 16 channels, from volts to decisions.

    Parameters
    ----------
    n_rows
        Number of rows.
    rounds
        How often the sides take turns.

    Raises
    ------
    RuntimeError
        When the chain and a rival decide differently.
    """
    config = ChainConfig()
    rows = swelling_noise_v(n_rows, config.channels)
    pieces = [rows[i : i + ROWS_PER_CALL] for i in range(0, len(rows), ROWS_PER_CALL)]
    chain, median = SlipChain(config), SlipChain(ChainConfig(common_mode='median'))
    evidence = SlipChain(ALL_OF_EVIDENCE)
    plain, in_place = NumpyChain(config, rows[0]), NumpyChain(config, rows[0], in_place=True)
    cpp, left_out = _cpp_chain(config)
    mine = chain.update(rows)
    ours = {name: getattr(mine, name) for name in ('slip', 'groups', 'channels')}
    agreement = {
        'numpy': _agreement(ours, dict(zip(ours, plain.update(rows), strict=True))),
        'in_place': _agreement(ours, dict(zip(ours, in_place.update(rows), strict=True))),
    }
    if cpp:
        agreement['cpp'] = _agreement({'flags': mine.flags}, {'flags': cpp.update(rows)})
    if min(agreement.values()) < LEAST_AGREEMENT:
        raise RuntimeError(f'the chain and its rivals decide differently: {agreement}')

    def decisions(part: Floats) -> None:
        chain.update(part, envelope=False, level=False)

    sides: dict[str, Callable[[], None]] = {
        'chain': _turn(decisions, [rows]),
        'kept': _turn(chain.update, [rows]),
        'numpy': _turn(plain.update, [rows]),
        'chain_in_pieces': _turn(decisions, pieces),
        'kept_in_pieces': _turn(chain.update, pieces),
        'median_in_pieces': _turn(
            lambda part: median.update(part, envelope=False, level=False), pieces
        ),
        'evidence_in_pieces': _turn(
            lambda part: evidence.update(part, envelope=False, level=False), pieces
        ),
        'in_place_in_pieces': _turn(in_place.update, pieces),
    }
    if cpp:
        sides['cpp_in_pieces'] = _turn(cpp.update, pieces)
    times_s = least_times_s(list(sides.values()), rounds, time.thread_time)
    ns = {name: s / len(rows) * 1e9 for name, s in zip(sides, times_s, strict=True)}
    in_pieces = ns['chain_in_pieces']
    return {
        'rows': len(rows),
        'rows_per_call': min(ROWS_PER_CALL, len(rows)),
        'channels': config.channels,
        'rounds': rounds,
        'agreement': agreement,
        'slip_share': float(mine.slip.mean()),
        'ns_per_row': ns,
        'speedup': ns['numpy'] / ns['chain'],
        'in_place_speedup': ns['in_place_in_pieces'] / in_pieces,
        'cpp_ratio': in_pieces / ns['cpp_in_pieces'] if cpp else None,
        'cpp_left_out': left_out,
        'cpp_command': ' '.join([*find_compiler(), *compiler_options()]),
        'kept_ratio': ns['kept_in_pieces'] / in_pieces,
        'whole_kept_ratio': ns['kept'] / ns['chain'],
        'median_ratio': ns['median_in_pieces'] / in_pieces,
        'evidence_ratio': ns['evidence_in_pieces'] / in_pieces,
    }


def _cpp_chain(config: ChainConfig) -> tuple[CppChain | None, str]:
    """Return the chain in C++, or why it is left out."""
    try:
        return CppChain(config), ''
    except RuntimeError as error:
        return None, str(error)


def _agreement(ours: Mapping[str, Bools], theirs: Mapping[str, Bools]) -> float:
    """Return the share of equal decisions, for the kind of decision with the least agreement."""
    return min(float((ours[name] == theirs[name]).mean()) for name in ours)


def _turn(update: Callable[[Floats], object], parts: list[Floats]) -> Callable[[], None]:
    def run() -> None:
        for part in parts:
            update(part)

    return run
