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

"""How large the report of an hour is, and how long a browser takes to draw it."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tune.browser import ready_ms, why_no_browser
from slip_detector.chain.samples import Samples
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report import page as report
from slip_detector.report.overview import Overview, events_of
from slip_detector.report.page_sections import Variant
from slip_detector.scenes import find_scene, load_scene

#: The hour consists of these scenes, which are repeated.
SCENES = ('plate_400um', 'taps', 'tremor_hum', 'rolling')

#: Noise that is added to each sample: repetitions without noise would compress too well.
NOISE_V = 5e-4

#: Two variants that differ as much as a chain before and after a search.
CONFIGS = {
    'given': ChainConfig(),
    'tuned': ChainConfig(
        passband_hz=(12.0, 80.0), stopbands_hz=(), vote='mean', threshold=2.0,
        envelope_window_s=0.03,
    ),
}  # fmt: skip


def measure_report(duration_s: float = 3600.0) -> dict[str, Any]:
    """Write the report of two variants on 16 channels at 380 Hz, and open it.

    Returns
    -------
    dict
        ``duration_s``; ``bytes`` of the file; ``ready_ms`` from the start of loading until the
        timeline is drawn, the least of three; None where no page can be opened, ``skipped`` then
        says why.
    """
    skipped = why_no_browser()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'report.html'
        report.write_page(path, 'An hour', _variants(duration_s))
        return {
            'duration_s': duration_s,
            'bytes': path.stat().st_size,
            'ready_ms': None if skipped else ready_ms(path),
            'skipped': skipped,
        }


def _variants(duration_s: float) -> list[Variant]:
    parts = [_scene(name) for name in SCENES]
    variants = []
    for name, config in CONFIGS.items():
        overview = Overview('hour', config)
        random = np.random.default_rng(0)
        outcome = Replay(config, scores=False).run(
            _pieces(parts, round(duration_s * config.sample_rate_hz), random), observer=overview
        )
        overview.finish(events_of(outcome))
        variants.append(Variant(name, config, [overview], {'hour': figures_of_merit([outcome])}))
    return variants


def _scene(name: str) -> Samples:
    scene = load_scene(find_scene(name), np.random.default_rng(0))
    samples = scene.read(1_000_000)  # more than any of them has
    return Samples.evenly(samples.volts, 380.0, np.asarray(samples.truth, dtype=bool))


def _pieces(parts: list[Samples], rows: int, random: np.random.Generator) -> Iterator[Samples]:
    """Yield the parts, repeated and with noise, until there are this many rows."""
    left = rows
    while left > 0:
        for volts, truth, *_ in parts:
            some = volts[:left]
            yield Samples.evenly(
                some + NOISE_V * random.standard_normal(some.shape), 380.0, truth[:left]
            )
            left -= len(some)
