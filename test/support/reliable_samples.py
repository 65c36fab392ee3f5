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

"""Run an executable whose samples are reliable, for a test that needs each of them.

Where a process has not run for a second (a busy machine), Fast DDS replaces its ports in shared
memory, and what waits in them is lost. The nodes bridge a lost sample; a test that sends the next
one when the last was answered would wait for ever.
"""

import functools
import sys

from slip_detector.nodes import messages

if __name__ == '__main__':
    messages.sensor_qos = functools.partial(messages.event_qos, depth=1000)
    # Only now: the modules take the profile by its name.
    from slip_detector.nodes.run import main

    main(sys.argv.pop(1))
