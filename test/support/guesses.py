"""Decisions that know nothing of slip."""

import numpy as np


def guessed(random, rows, mean_on_rows, mean_off_rows, regular=False):
    """Return decisions that are ON and OFF in turn for random times of these mean lengths.

    They begin at a random place. With ``regular`` all times have their mean length.
    """
    pairs = int(2.0 * rows / (mean_on_rows + mean_off_rows)) + 20
    turns = np.empty(2 * pairs, np.int64)
    for k, mean in enumerate((mean_on_rows, mean_off_rows)):
        turns[k::2] = round(mean) if regular else random.geometric(1.0 / mean, pairs)
    on = np.repeat(np.arange(turns.size) % 2 == 0, turns)
    return np.resize(on[random.integers(0, on.size // 4) :], rows)
