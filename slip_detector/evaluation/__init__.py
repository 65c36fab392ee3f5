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

"""Runs recordings through a chain, matches slips with alarms, and computes figures.

``Replay`` runs a chain over rows, and ``evaluate_recording`` over a file that a
``RecordingLoader`` opens; ``figures_of_merit`` are the figures of their outcomes.
"""

from slip_detector.evaluation.evaluator import RecordingLoader, evaluate_recording
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay

__all__ = ['RecordingLoader', 'Replay', 'evaluate_recording', 'figures_of_merit']
