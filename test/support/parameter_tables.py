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

"""The tables of docs/parameters.md and docs/scenes.md; as a program it writes them.

python test/support/parameter_tables.py
"""

import dataclasses
import re
from pathlib import Path

from slip_detector.parameters import ChainConfig, RecordingConfig
from slip_detector.parameters.fields import allowed, under_headings
from slip_detector.parameters.sections import SECTIONS, set_of
from slip_detector.scenes.motion import Step
from slip_detector.scenes.parts import PARTS, Sampling

ROOT = Path(__file__).resolve().parents[2]


def sections_of(config_class):
    """Return the fields of a set of parameters below its headings, without inherited ones."""
    own = config_class.__annotations__
    return {
        heading: [field for field in fields if field.name in own]
        for heading, fields in under_headings(config_class).items()
        if any(field.name in own for field in fields)
    }


#: The tables of each file by the name at their place: the fields below each heading.
TABLES = {
    ROOT / 'docs' / 'parameters.md': {
        each.__name__: sections_of(each)
        for each in (ChainConfig, RecordingConfig, *map(set_of, SECTIONS))
    },
    ROOT / 'docs' / 'scenes.md': {
        'parts': {
            'The scene itself': dataclasses.fields(Sampling),
            '`steps`: Each of them.': dataclasses.fields(Step),
            **{
                f'`{name}`: {part.__doc__.splitlines()[0]}': dataclasses.fields(part)
                for name, part in PARTS.items()
            },
        }
    },
}


#: What each file says of a parameter. The limits of a scene are said where one is exceeded.
COLUMNS = {
    'parameters.md': ('parameter', 'default', 'allowed', 'meaning'),
    'scenes.md': ('parameter', 'default', 'meaning'),
}


def table(sections, columns):
    """Lay out fields as a Markdown table, each heading as a row above its fields."""
    rows = []
    for heading, fields in sections.items():
        name, _, about = heading.partition(': ')
        rows += [[f'**{name}**', *[''] * (len(columns) - 2), about]] if heading else []
        rows += [[cells(field)[column] for column in columns] for field in fields]
    lines = [f'| {" | ".join(row)} |' for row in (columns, *rows)]
    return '\n'.join([lines[0], '|---' * len(columns) + '|', *lines[1:]])


def cells(field):
    """Return what a table says of a field, by column."""
    unit = field.metadata['unit']
    return {
        'parameter': f'`{field.name}`',
        'default': f'{shown(field.metadata["default"])} {unit}'.strip(),
        'allowed': allowed(field).removesuffix(f' {unit}'),
        'meaning': field.metadata['meaning'],
    }


def shown(value):
    """Write a default as YAML has it."""
    if isinstance(value, bool):
        return f'`{str(value).lower()}`'
    if isinstance(value, tuple):
        flat = [n for item in value for n in (item if isinstance(item, tuple) else (item,))]
        return f'`[{", ".join(n if isinstance(n, str) else f"{n:g}" for n in flat)}]`'
    if isinstance(value, dict):
        return ''
    if isinstance(value, str):
        return f'`{value}`' if value else "`''`"
    return f'`{value:g}`'


def with_tables(path):
    """Return a file's text with the tables as they should be."""
    text = path.read_text(encoding='utf-8')
    for name, sections in TABLES[path].items():
        pattern = rf'(<!-- {name} -->\n).*?(<!-- end -->)'
        rows = table(sections, COLUMNS[path.name])
        text, found = re.subn(pattern, lambda m, r=rows: f'{m[1]}{r}\n{m[2]}', text, flags=re.S)
        assert found == 1, f'{path.name} has no place for {name}'
    return text


if __name__ == '__main__':
    for document in TABLES:
        document.write_text(with_tables(document), encoding='utf-8')
