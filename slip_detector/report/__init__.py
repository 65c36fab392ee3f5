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

"""Output for people; each file is imported where it is used, as plotting takes long to load.

``texts`` has the answer in sentences and tables of plain text, ``page`` a report that is one HTML
file, ``overview`` what the report draws of a recording, and ``pictures`` pictures of trials and
grasps.
"""
