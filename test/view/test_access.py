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

"""Who may open the page: no name and no origin of another site, no wrong token."""

import string
from urllib.parse import parse_qs, urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.view.access import (
    Access,
    host_name,
    is_address,
    is_loopback,
    page_address,
)

LOCAL = Access('127.0.0.1', names=frozenset({'robot', 'robot.local'}))
OPEN = Access('0.0.0.0', token='secret', names=frozenset({'robot', 'robot.local'}))
OURS = ('localhost', '127.0.0.1', '127.0.0.2', '[::1]')
LETTERS = st.text(string.ascii_lowercase + string.digits + '-', min_size=1, max_size=12)
SITES = st.lists(LETTERS, min_size=2, max_size=4).map('.'.join)
PORTS = st.integers(1, 65535)
WRONG = ['', 'localhost/x', 'a@localhost', 'localhost:port', '[::1', 'a b', 'localhost:99999']


@pytest.mark.parametrize('access', [LOCAL, OPEN])
@pytest.mark.parametrize('name', OURS)
def test_the_page_itself_may(access, name):
    for host in (name, f'{name}:8765'):
        assert access.refusal(host, None) == ''
        assert access.refusal(host, f'http://{host}') == ''


@pytest.mark.parametrize(
    'name', ['robot', 'robot.local', 'ROBOT.local', '192.168.1.5', '[fe80::1]']
)
def test_names_and_addresses_in_the_network_are_for_a_server_that_is_in_it(name):
    host = f'{name}:8765'
    assert OPEN.refusal(host, f'http://{host}') == ''
    assert LOCAL.refusal(host, f'http://{host}') != ''


@pytest.mark.parametrize('access', [LOCAL, OPEN])
@given(site=SITES, port=PORTS)
def test_no_site_reaches_the_server_by_its_own_name(access, site, port):
    # An address that other names lead to, too: a site can have its name lead to this machine.
    if host_name(site) and not site.replace('.', '').isdigit():
        assert access.refusal(f'{site}:{port}', None).startswith('Host is')
        assert access.refusal(f'{site}:{port}', f'http://{site}:{port}').startswith('Host is')


@pytest.mark.parametrize('access', [LOCAL, OPEN])
@given(
    origin=st.text(max_size=40)
    | SITES.map('http://{}'.format)
    | st.sampled_from(['null', '', 'https://localhost:8765', 'http://localhost:8766'])
)
def test_no_other_page_may_talk_to_the_server(access, origin):
    assert access.refusal('localhost:8765', origin).startswith('Origin is')


@given(host=st.text(max_size=60) | st.sampled_from(WRONG))
def test_a_host_header_is_judged_in_one_line(host):
    name = host_name(host)
    refusal = LOCAL.refusal(host, None)
    assert len(refusal) < 300
    if name is None or not is_loopback(name):
        assert refusal.startswith('Host is')


@given(token=st.text(max_size=30))
def test_only_the_token_opens_the_page(token):
    assert OPEN.knows(token) == (token == 'secret')
    assert LOCAL.knows(token)


@given(token=st.text(st.characters(exclude_categories=['Cs']), max_size=20))
def test_the_address_has_the_token_whatever_it_is(token):
    query = urlsplit(page_address('robot', 8470, token)).query
    assert parse_qs(query, keep_blank_values=True) == ({'token': [token]} if token else {})


@pytest.mark.parametrize('host', ['0.0.0.0', '::', ''])
def test_a_server_for_all_addresses_has_one_that_others_can_open(host):
    parts = urlsplit(page_address(host, 8470))
    if is_address(parts.hostname):  # else the machine has none, and its name stands there
        assert (':' in parts.hostname) == (host == '::')
    assert parts.hostname not in ('0.0.0.0', '::', '')
    access = Access(host or '0.0.0.0', token='secret')
    assert access.refusal(parts.netloc, f'http://{parts.netloc}') == ''
