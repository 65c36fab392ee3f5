"""Compiles the chain, or loads it from the cache, before the first sample comes."""

import numpy as np

from slip_detector.chain.settling import settling_rows
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.stamps import StampGrid


def compile_chain() -> None:
    """Run each compiled function of the chain and of the stamps once.

    Without a cache this takes seconds. What it has compiled serves any configuration, and any
    later process of the same user.

    Examples
    --------
    >>> compile_chain()
    """
    chain = SlipChain()
    settling_rows(chain.config)
    grid = StampGrid(period_s=1.0, max_gap_s=1.0)
    stamps_ns = np.arange(3) * 1_000_000_000
    grid.arrive_all(stamps_ns[:2])
    grid.arrive(int(stamps_ns[2]))
