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

"""Recordings of all kinds with damage anywhere."""

import contextlib
import io
import struct
import zipfile
from pathlib import Path

import numpy as np
from fuzz.fuzzing import fuzz, mutated_bytes, put
from hypothesis import strategies as st

from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import open_recording, write_recording
from support.bags import ENDINGS, NAMES, check_same, rows
from support.limits import little_memory
from support.recorded import read_recording

#: In the folder of a bag this file has the bytes of a case.
METADATA = '/metadata.yaml'

#: What reading may hold at a time, and what a process may take for it.
CONFIG = RecordingConfig(recording_limit_mb=8.0)
MOST_BYTES = 1_000_000_000


def npz(**arrays):
    """Return an npz; arrays may be given as the bytes of their npy."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name, value in arrays.items():
            with archive.open(f'{name}.npy', 'w') as file:
                if isinstance(value, bytes):
                    file.write(value)
                else:
                    np.save(file, value)
    return buffer.getvalue()


def declared(shape, begin=b''):
    """Return an npy that declares a shape and has only the beginning of it."""
    header = io.BytesIO()
    described = {'descr': '<f8', 'fortran_order': False, 'shape': shape}
    np.lib.format.write_array_header_1_0(header, described)
    return header.getvalue() + begin


def corpus(found):
    volts = np.zeros((50, 2))
    yield '.npz', npz(volts=declared((1, 10**9)), sample_rate_hz=380.0)
    yield '.npz', npz(volts=declared((10**9, 3), bytes(10**7)), sample_rate_hz=380.0)
    yield '.npz', npz(volts=declared((4, 2), bytes(3 * 10**7)), sample_rate_hz=380.0)
    yield '.npz', npz(volts=declared((-1, -1)), sample_rate_hz=380.0)
    yield '.npz', npz(volts=volts, sample_rate_hz=declared((10**9,)))
    yield '.npz', npz(volts=volts, slip=declared((50, 10**9)), sample_rate_hz=380.0)
    yield '.npz', npz(volts=volts, sample_rate_hz=1e6, stamps_ns=np.arange(50) * 90_000_000)
    yield '.npz', npz(**{'a\nb': volts})
    yield '.mcap', found['.mcap'][:8] + struct.pack('<BQ', 5, 2**63)
    yield '.mcap', found['.mcap'][:8] + struct.pack('<BQ', 6, 5) + bytes(5)
    yield METADATA, b'[' * 200_000
    yield METADATA, b'- ' * 200_000
    yield METADATA, b'a: &a [*a]'
    for about in (b'1', b'[1]', b'{custom_data: [1]}', b'{custom_data: {kind: [1]}}'):
        yield METADATA, b'rosbag2_bagfile_information: ' + about
    yield '.csv', b'time_s,a,b\n0,1,2\n1e999999999999999999,1,2\n'
    yield '.csv', b'"time_s\r",a\n0,1\n1,1\n'
    yield '.csv', b'time_s,' + b','.join(b'c%d' % k for k in range(100_000)) + b'\n'
    yield '.csv', b'time_s,a,b\n' + bytes(20_000)
    yield '.csv', b'time_s,a,b\n1e' + b'9' * 20_000 + b',1,2\n'
    for ending, data in found.items():
        yield ending, Path('/dev/zero')
        yield ending, data
        yield ending, b''
        yield ending, data[: len(data) // 2]
        yield ending, bytes(len(data))


def test_any_bytes_are_read_or_refused_in_one_line_and_never_take_much_memory(tmp_path):
    for ending in ENDINGS:
        write_recording(tmp_path / f'some{ending}', [rows(60)], 380.0, NAMES)
    endings = *filter(None, ENDINGS), METADATA
    paths = {ending: Path(f'{tmp_path}/some{ending}') for ending in endings}
    found = {ending: path.read_bytes() for ending, path in paths.items()}

    def check(case):
        ending, data = case
        put(data, paths[ending])
        path = paths[ending].parent if ending == METADATA else paths[ending]
        with little_memory(MOST_BYTES):
            for piece in open_recording(path, CONFIG).pieces():
                assert piece.volts.shape[0] == len(piece.stamps_ns)
                assert (np.diff(piece.stamps_ns) > 0).all()

    cases = [
        st.tuples(st.just(ending), mutated_bytes([data], most=6)) for ending, data in found.items()
    ]
    fuzz(st.one_of(cases), check, corpus=list(corpus(found)), few=40, refusal='some[.:]')


def test_of_an_mcap_all_before_the_damage_is_read_as_it_was_and_the_damage_said(tmp_path):
    folder, written = tmp_path / 'some', rows(1000)
    write_recording(folder, [written], 380.0, NAMES)
    file = folder / 'some.mcap'
    whole = file.read_bytes()
    ends = [whole.index(row.tobytes()) + row.nbytes for row in written.volts]

    def check(case):
        damage, place, length, path = case
        place %= len(whole)
        end = len(whole) if damage == 'cut' else place + length
        there = bytearray(whole)
        there[place:end] = bytes(b ^ 1 << place % 8 for b in there[place:end])
        if damage != 'flip':
            there[place:end] = bytes(end - place if damage == 'zero' else 0)
        file.write_bytes(there)
        n = 0
        with contextlib.suppress(ValueError):
            recording, read = read_recording(path, CONFIG)
            n = len(read.volts)
            check_same(read, written.take(slice(n)))
            assert n == len(written.volts) or recording.counts.damage
        # Of a chunk whose checksum is wrong nothing is read.
        assert n > np.searchsorted(ends, place) - 381 * (damage != 'cut') - 2

    damages, places = st.sampled_from(['cut', 'zero', 'flip']), st.integers(0, 10**9)
    paths = st.sampled_from([folder, file])
    cases = st.tuples(damages, places, st.integers(1, 5000), paths)
    fuzz(cases, check, corpus=(), few=60)
