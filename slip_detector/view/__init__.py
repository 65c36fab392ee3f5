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

"""The live page: what a browser shows of the fingers, and the requests that it may send.

| file | what it is for |
|---|---|
| ``detectors`` | what is known of each finger; nodes derive :class:`.detectors.Detectors` |
| ``track``, ``view_request`` | the last minute of a finger, and the frames that pages get of it |
| ``server``, ``access`` | :class:`.server.Server`, and who may reach it: :class:`.access.Access` |
| ``messages`` | what a page may send |
| ``parameters`` | :class:`.parameters.ParameterRequests`: parameters are shown, set, saved |
| ``teaching`` | :class:`.teaching.Teaching`: recordings are made and tuned on |
| ``recordings``, ``hand_labels``, ``tuning`` | the recordings, their labels, a run of the tuner |
| ``bag`` | :class:`.bag.PlayedBag`: a recording is played and labelled |

They are imported from their files, as most load much.
"""
