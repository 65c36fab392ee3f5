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

"""The name, type, range and default of every parameter are what they were.

The golden file is written anew by ``python test/golden/test_parameters.py``; a change to it is a
decision, which the message of its commit names.
"""

import dataclasses
import json
from pathlib import Path

from slip_detector.parameters import RecordingConfig
from slip_detector.parameters.fields import allowed
from slip_detector.parameters.sections import SECTIONS

GOLDEN = Path(__file__).parent / 'parameters.json'
SETS = (RecordingConfig, *SECTIONS.values())


def described(kind):
    """Return what users see of each parameter of a set, in the form of JSON."""
    return {
        field.name: {
            'type': str(field.type),
            'default': repr(field.metadata['default']),
            'allowed': allowed(field),
            **{key: field.metadata[key] for key in ('unit', 'low', 'high', 'heading')},
            'choices': list(field.metadata['choices']),
        }
        for field in dataclasses.fields(kind)
    }


def test_every_parameter_is_what_it_was():
    found = {kind.__name__: described(kind) for kind in SETS}
    wanted = json.loads(GOLDEN.read_text(encoding='utf-8'))
    assert {name: list(sets) for name, sets in found.items()} == {
        name: list(sets) for name, sets in wanted.items()
    }
    assert found == wanted


if __name__ == '__main__':
    content = {kind.__name__: described(kind) for kind in SETS}
    GOLDEN.write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')
