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

"""examples/send_packets.c and .py: what they send is what the driver's decoder takes."""

import contextlib
import shutil
import subprocess
import sys

import numpy as np
import pytest

from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from slip_detector.sources.packets import PacketDecoder, cobs_decode
from support.pages import ROOT
from support.sensors import free_udp_port

EXAMPLE_C = ROOT / 'examples' / 'send_packets.c'
EXAMPLE_PYTHON = ROOT / 'examples' / 'send_packets.py'

#: What stands in for the board: a sample is taken each 1000 us, and bytes go to stdout. With an
#: argument stdin is one packet. What stuffs it is private, so the file is included.
BOARD = """
#include <stdio.h>
#include "send_packets.c"
static uint32_t now_us = 4294960000u;
void send_byte(uint8_t byte) { putchar(byte); }
uint32_t micros(void) { return now_us += 1000u; }
int main(int argc, char **argv)
{
    int16_t values[16];
    static uint8_t data[9000];
    (void)argv;
    if (argc > 1)
        send_stuffed(data, (uint32_t)fread(data, 1, sizeof data, stdin));
    while (fread(values, sizeof values, 1, stdin))
        send_sample(values);
    return 0;
}
"""

#: Some with zeros in them, some without, and the ends of the range.
INTEGERS = np.random.default_rng(8).choice([-32768, 0x0101, 0, 1, 32767], (300, 16))
INTEGERS[:6] = np.array([-32768, 0x0101, 0])[np.arange(6) // 2, np.newaxis]


@pytest.fixture(scope='module')
def board(tmp_path_factory):
    """Compile the board; return what it sends for some input."""
    compiler = shutil.which('cc') or shutil.which('gcc')
    if compiler is None:
        pytest.skip('no C compiler')
    source = tmp_path_factory.mktemp('board') / 'board.c'
    source.write_text(BOARD)
    program = source.with_suffix('')
    strict = ['-std=c99', '-Wall', '-Wextra', '-Werror', '-pedantic', f'-I{EXAMPLE_C.parent}']
    subprocess.run([compiler, *strict, '-o', program, source], check=True)
    return lambda data, *words: subprocess.check_output([program, *words], input=data)


def test_c_sends_what_the_driver_takes(board):
    decoder = PacketDecoder(16, 'int16', 1.0, 0.0)
    received = decoder.feed(board(INTEGERS.astype('<i2').tobytes()))
    np.testing.assert_array_equal(np.concatenate([r.volts for r in received]), INTEGERS)
    times_ns = [r.stamps_ns[0] for r in received]
    assert np.diff(times_ns).tolist() == [1_000_000] * (len(INTEGERS) - 1)
    assert +decoder.counts == {'packets': len(INTEGERS), 'samples': len(INTEGERS)}


def test_c_stuffs_long_packets_as_it_should(board):
    # More than 254 bytes without a zero, just as many, and one more or less.
    for plain in (b'', b'\0', b'\1' * 253, b'\1' * 254, b'\1' * 255, b'\1' * 254 + b'\0' * 3):
        line = board(plain, 'stuff')
        assert line[-1] == 0
        assert cobs_decode(line[:-1]) == plain


def test_python_as_a_program_sends_volts_that_vibrate_with_the_right_times():
    config = DriverConfig(source='udp', udp_port=free_udp_port())
    source = open_source(config)
    source.start()
    command = [sys.executable, EXAMPLE_PYTHON, '127.0.0.1', str(config.udp_port)]
    with contextlib.closing(source), subprocess.Popen(command) as program:
        try:
            stamps_ns, rows = [], []
            while len(rows) < 900:
                samples = source.read(1)
                stamps_ns.extend(samples.stamps_ns)
                rows.extend(samples.volts)
                assert program.poll() is None
        finally:
            program.terminate()
    assert source.counts['samples'] == source.counts['packets'] * 10
    # On a busy machine a packet is sent late, and the next one overlaps it.
    assert (+source.counts).keys() - {'overlap'} == {'packets', 'samples'}
    volts = np.array(rows)
    assert np.all(np.abs(volts[:450].mean(axis=0) - 4.3) < 0.001)
    assert volts[510:900].std() > 10 * volts[:490].std()
    steps_ns = np.diff(np.array(stamps_ns, dtype=np.int64))
    assert np.all(steps_ns > 0)
