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

"""Lessons that are as bad as a person, through the functions of the live page.

A lesson records a simulated finger as the page does (rest, taps, presses where contact makes
noise, and slips with the time before and after), tunes with the page's own function, and applies
what that would apply. A hand presses the key after a slide begins and lets it go after its end,
later or less late in each of three lessons, forgets one slide of ten, and presses once while
nothing slides.
"""

import asyncio
import itertools
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import DetectorConfig, read_yaml
from slip_detector.recordings.labels import BY_HAND_S
from slip_detector.recordings.writing import BagWriter
from slip_detector.scenes import Scene, find_scene
from slip_detector.view.recordings import RecordedFolder
from slip_detector.view.teaching import AFTER_S, BEFORE_S
from slip_detector.view.tuning import TuneRun

#: How late a hand presses the key and lets it go, in seconds: one hand a lesson, in turn. The page
#: takes labels to be exact to 0.35 s.
HANDS_S = (
    ((0.12, 0.35), (0.08, 0.3)),
    ((0.22, 0.45), (0.18, 0.4)),
    ((0.32, 0.55), (0.28, 0.5)),
)

#: Which of the slides is forgotten, and after which the key is pressed by mistake.
FORGOTTEN, MISTAKEN = 3, 1

REST_S, TAPS_S = 30.0, 30.0

#: Speed and length of the slides, and how long the finger rests before the next one, in seconds.
SPEEDS_M_S, SLIDES_S, RESTS_S = (6.7e-3, 20e-3), (0.8, 2.5), (3.5, 5.0)

#: Seconds between two knocks while taps are recorded.
KNOCKS_S = 1.5

#: Force in rest and slides, where contact makes noise.
HELD_N = 1.0

#: A press: squeezed, let go, lifted off, and touched again.
PRESS = [
    {'duration_s': duration_s, 'force_n': force_n}
    for duration_s, force_n in (
        (0.3, 2.5), (0.8, 2.5), (0.3, HELD_N), (0.8, HELD_N),
        (0.2, 0.0), (0.6, 0.0), (0.2, HELD_N), (0.8, HELD_N),
    )
]  # fmt: skip

#: How often the finger is pressed where a family has noise of contact.
PRESSES = 8

#: Seconds from contact to the first slide.
BEGIN_S = 4.8

#: Slides on which a lesson is judged.
JUDGED = 12

#: Figures of what is no slip, where it is part of a lesson.
ON = ('rest_percent', 'taps_percent', 'press_percent')

FIGURES = ('auc_all', 'recall', 'coverage', 'false_time_percent', 'latency_median_ms')


class Session:
    """A finger in contact with a plate that slides several times, or not at all.

    Attributes
    ----------
    slides_s : ndarray, shape (k, 2)
        Begin and end of each slide.
    samples : Samples
        With exact labels.
    """

    def __init__(
        self,
        parts: Mapping[str, Any],
        slides: int,
        random: np.random.Generator,
        rest_s: float = 0.0,
        knocks_s: Sequence[float] = (),
        presses: int = 0,
    ) -> None:
        slides_s, now_s = [], BEGIN_S
        # A hand that trembles as where contact makes noise holds more than it trembles.
        held_n = HELD_N if 'contact_noise' in parts else 0.4
        steps = [{'duration_s': 1.0}, {'duration_s': 0.8, 'force_n': held_n}, {'duration_s': 3.0}]
        for _ in range(slides):
            slide_s, after_s = random.uniform(*SLIDES_S), random.uniform(*RESTS_S)
            speed_m_s = float(random.uniform(*SPEEDS_M_S))
            steps.append({'duration_s': slide_s, 'velocity_m_s': speed_m_s})
            steps.append({'duration_s': after_s})
            slides_s.append((now_s, now_s + slide_s))
            now_s += slide_s + after_s
        steps += [{'duration_s': rest_s}] if rest_s else []
        steps += PRESS * presses
        self.slides_s = np.reshape(slides_s, (-1, 2))
        parts = dict(parts)
        if taps := parts.pop('taps', None):
            ends_s = [BEGIN_S - 1.0, *self.slides_s[:, 1]] if slides else []
            times_s = [*knocks_s, *(end_s + d for end_s in ends_s for d in (0.8, 1.5))]
            parts['taps'] = {**taps, 'times_s': times_s}
        scene = Scene({**parts, 'steps': steps}, random.spawn(1)[0])
        self.rate_hz, self.samples = scene.sample_rate_hz, scene.read(scene.length)

    def between(self, begin_s: float, end_s: float, label_s: Sequence[float] = ()) -> Samples:
        """Return the rows of a time; labelled as slip from one time to another, or not at all."""
        begin_s, end_s = max(begin_s, 0.0), min(end_s, len(self.samples.volts) / self.rate_hz)
        begin, end = (round(time_s * self.rate_hz) for time_s in (begin_s, end_s))
        part = self.samples.take(slice(begin, end))
        times_s = np.arange(begin, begin + len(part.volts)) / self.rate_hz
        label_s = label_s or (0.0, 0.0)
        return part._replace(truth=(times_s >= label_s[0]) & (times_s < label_s[1]))


def taught(session: Session, random: np.random.Generator, hand: int) -> Iterator[Samples]:
    """Yield the recordings of slips that a hand makes of a session, as the page makes them."""
    presses_s, (late_to_press_s, late_to_let_go_s) = [], HANDS_S[hand]
    for k, (begin_s, end_s) in enumerate(session.slides_s):
        late_s = random.uniform(*late_to_press_s), random.uniform(*late_to_let_go_s)
        if k % 10 != FORGOTTEN:
            presses_s.append((begin_s + late_s[0], end_s + late_s[1]))
        if k == MISTAKEN:
            presses_s.append((end_s + 1.2, end_s + 1.9))
    last_s = 0.0
    for press, following in itertools.zip_longest(presses_s, presses_s[1:]):
        # The next press ends the rest after a slip.
        end_s = min(press[1] + AFTER_S, following[0] if following else np.inf)
        yield session.between(max(press[0] - BEFORE_S, last_s), end_s, press)
        last_s = press[1]


def lesson(name: str, parts: Mapping[str, Any], slips: int, seed: int) -> dict[str, Any]:
    """Teach a detector with the paper's parameters; return the figures before and after."""
    random, hand = np.random.default_rng(seed), seed % len(HANDS_S)
    running = DetectorConfig()
    knocks_s = np.arange(BEGIN_S, BEGIN_S + TAPS_S, KNOCKS_S).tolist()
    knocking = {**parts, 'taps': read_yaml(find_scene('taps'))['taps']}
    quiet = {name: part for name, part in parts.items() if name != 'taps'}
    session = Session(parts, slips, random)
    rest, taps = Session(quiet, 0, random, REST_S), Session(knocking, 0, random, TAPS_S, knocks_s)
    presses = PRESSES if 'contact_noise' in parts else 0
    with tempfile.TemporaryDirectory() as temporary:
        recorded = RecordedFolder(Path(temporary))
        recordings = [('slip', rows) for rows in taught(session, random, hand)]
        recordings.append(('rest', rest.between(2.0, BEGIN_S + REST_S)))
        recordings.append(('taps', taps.between(2.0, BEGIN_S + TAPS_S)))
        if presses:
            press = Session(quiet, 0, random, presses=presses)
            recordings.append(('press', press.between(2.0, np.inf)))
        for kind, rows in recordings:
            accuracy_s = BY_HAND_S if kind == 'slip' else 0.0
            path, of_kind = recorded.new_path(kind), '' if kind == 'slip' else kind
            bag = BagWriter(path, running.names, accuracy_s=accuracy_s, kind=of_kind)
            bag.write(rows)
            bag.close()
        said, found = asyncio.run(_tuned(recorded, running))
    # Fresh seeds, exact labels, and the same plate.
    judged = Session(parts, JUDGED, random)
    still = {
        'rest': Session(quiet, 0, random, REST_S),
        'taps': Session(knocking, 0, random, TAPS_S, knocks_s),
        **({'press': Session(quiet, 0, random, presses=presses)} if presses else {}),
    }
    configs = {'before': running, 'after': found or running}
    figures = {when: _figures(judged, still, config) for when, config in configs.items()}
    return {'family': name, 'seed': seed, 'hand': hand, **figures, 'said': said}


async def _tuned(
    recorded: RecordedFolder, running: DetectorConfig
) -> tuple[list[str], DetectorConfig | None]:
    """Tune as the page does; return what it said, and the parameters that it would apply."""
    await recorded.refresh()
    run = TuneRun(recorded, 'index', running)
    await run.run()
    said = [*run.said['lines'], run.failed, run.said['kept']] + [
        f'{row[0]}: {row[1]} -> {row[2]} {row[3]}' for row in run.said['table']
    ]
    return said, None if run.said['kept'] else run.found


def _figures(judged: Session, still: Mapping[str, Session], config: DetectorConfig) -> Any:
    replay = Replay(config)
    figures = figures_of_merit([replay.run([judged.samples], judged.rate_hz)])
    on = {
        f'{name}_percent': figures_of_merit([replay.run([one.samples], one.rate_hz)])[
            'false_time_percent'
        ]
        for name, one in still.items()
    }
    return {name: figures[name] for name in FIGURES} | on
