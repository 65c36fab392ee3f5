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

"""HTML taken apart as a browser would, without a browser."""

import json
from html.parser import HTMLParser


class HtmlPage(HTMLParser):
    """Tags, texts and the contents of scripts, as a browser would take them apart."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.texts, self.scripts, self._script = [], [], {}, None
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self._script = dict(attributes).get('id', 'code') if tag == 'script' else None

    def handle_endtag(self, tag):
        self._script = None

    def handle_data(self, data):
        if self._script is not None:
            self.scripts[self._script] = self.scripts.get(self._script, '') + data
        else:
            self.texts.append(data)

    @property
    def header(self):
        return json.loads(self.scripts['header'])
