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

"""The algorithm (the paper's Section 2), from rows of volts to decisions.

Other rooms use ``slip_chain`` (the chain), ``live_chain`` (a chain whose parameters change, and
decisions that mean nothing), ``filters`` (the design), ``stamps`` (missing samples), ``samples``
(the container of rows) and ``layout`` (the order of flags). Nothing is imported here, so that
rooms that need only the container load neither Numba nor SciPy.
"""
