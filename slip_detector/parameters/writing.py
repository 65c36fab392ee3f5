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

"""Writes ROS parameter files."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.files import whole_file
from slip_detector.parameters.reading import node_of, sections_of
from slip_detector.parameters.yaml_files import read_yaml


def with_parameters(given: str | Path | None, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a parameter file with changed values for the detector.

    Parameters
    ----------
    given
        The file to start from; None: the defaults of the detector.
    changes
        New values by the name of the parameter, in the form that ROS uses (flat lists).

    Returns
    -------
    dict
        The whole document, with the sections of other nodes but without comments.

    Raises
    ------
    ValueError
        When the file cannot be read; names it.

    Examples
    --------
    >>> document = with_parameters(None, {'threshold': 0.25})
    >>> document['/**/slip_detector']['ros__parameters']['threshold']
    0.25
    """
    if given is None:
        document: dict[str, Any] = yaml.safe_load(DetectorConfig().to_yaml())
    else:
        document = read_yaml(given)
    sections = list(sections_of(document, str(given)))
    own = [parameters for name, parameters in sections if node_of(name) == DetectorConfig.NODE]
    if not own:
        own = [{}]
        document[f'/**/{DetectorConfig.NODE}'] = {'ros__parameters': own[0]}
    for name, parameters in sections:
        # A section for all nodes that comes after the detector's would override it.
        if node_of(name) == '**':
            parameters.update({key: changes[key] for key in changes if key in parameters})
    own[-1].update(changes)
    return document


def write_file(path: Path, document: Mapping[str, Any], comments: Iterable[str]) -> None:
    """Write a document with comments above it.

    Raises
    ------
    ValueError
        When the file cannot be written; names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'tuned.yaml'
    ...     write_file(path, {'slip_detector': {'ros__parameters': {'vote': 2}}}, ['Tuned.'])
    ...     print(path.read_text().splitlines()[0])
    # Tuned.
    """
    text = ''.join(f'# {line}'.rstrip() + '\n' for line in comments)
    text += yaml.safe_dump(document, sort_keys=False, default_flow_style=None, allow_unicode=True)
    with whole_file(path) as new:
        new.write_text(text, encoding='utf-8')
