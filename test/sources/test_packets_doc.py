"""docs/packets.md: its examples run against the decoder, its tables against the code."""

import re
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import packets
from slip_detector.sources.packets import (
    CHECKSUM,
    HEADER,
    KINDS,
    LONGEST_BYTES,
    PacketDecoder,
    encode,
)
from slip_detector.sources.source import open_live_source
from support.sensors import free_udp_port

TEXT = (Path(__file__).resolve().parents[2] / 'docs' / 'packets.md').read_text(encoding='utf-8')

#: What stands in for the board: bytes go to stdout, a sample is taken each 1000 us.
BOARD = """
#include <stdint.h>
#include <stdio.h>
static uint32_t now_us = 4294960000u;
void send_byte(uint8_t byte) { putchar(byte); }
uint32_t micros(void) { return now_us += 1000u; }
void send_sample(const int16_t values[16]);
int main(void)
{
    int16_t values[16];
    while (fread(values, sizeof values, 1, stdin))
        send_sample(values);
    return 0;
}
"""

#: Some with zeros in them, some without, and the ends of the range.
INTEGERS = np.concatenate(
    [
        np.zeros((2, 16), int),
        np.random.default_rng(8).integers(-32768, 32768, (300, 16)),
        np.full((2, 16), -32768),
        np.full((2, 16), 0x0101),
        np.full((2, 16), 32767),
    ]
)


def example(language):
    (code,) = re.findall(rf'```{language}\n(.*?)```', TEXT, re.S)
    return code


def test_the_example_in_c_sends_what_the_driver_takes(tmp_path):
    compiler = shutil.which('gcc') or shutil.which('cc')
    if compiler is None:
        pytest.skip('no C compiler')
    (tmp_path / 'sensor.c').write_text(example('c'))
    (tmp_path / 'board.c').write_text(BOARD)
    build = [compiler, '-std=c99', '-Wall', '-Wextra', '-Werror', '-pedantic', '-o', 'sensor']
    subprocess.run([*build, 'sensor.c', 'board.c'], cwd=tmp_path, check=True)
    line = subprocess.run(
        [tmp_path / 'sensor'], input=INTEGERS.astype('<i2').tobytes(), stdout=-1, check=True
    ).stdout
    decoder = PacketDecoder(16, 'int16', 1.0, 0.0)
    received = decoder.feed(line)
    np.testing.assert_array_equal(np.concatenate([r.volts for r in received]), INTEGERS)
    times_ns = [r.times_ns[0] for r in received]
    assert np.diff(times_ns).tolist() == [1_000_000] * (len(INTEGERS) - 1)
    assert +decoder.counts == {'packets': len(INTEGERS), 'samples': len(INTEGERS)}


def test_long_packets_in_c_are_stuffed_as_they_should_be(tmp_path):
    compiler = shutil.which('gcc') or shutil.which('cc')
    if compiler is None:
        pytest.skip('no C compiler')
    # More than 254 bytes without a zero, just as many, and one more or less.
    (tmp_path / 'stuff.c').write_text(
        example('c')
        + '#include <stdio.h>\n'
        + 'void send_byte(uint8_t byte) { putchar(byte); }\n'
        + 'uint32_t micros(void) { return 0; }\n'
        + 'int main(void) { static uint8_t data[9000];\n'
        + 'send_stuffed(data, fread(data, 1, sizeof data, stdin)); return 0; }\n'
    )
    subprocess.run([compiler, '-o', 'stuff', 'stuff.c'], cwd=tmp_path, check=True)
    for plain in (b'', b'\0', b'\1' * 253, b'\1' * 254, b'\1' * 255, b'\1' * 254 + b'\0' * 3):
        line = subprocess.run([tmp_path / 'stuff'], input=plain, stdout=-1, check=True).stdout
        assert line[-1] == 0
        assert packets.cobs_decode(line[:-1]) == plain


def test_the_example_in_python_sends_what_the_driver_takes():
    names = {}
    exec(example('python'), names)
    port = free_udp_port()
    source = open_live_source(DriverConfig(source='udp', udp_port=port), time.time_ns)
    batches = INTEGERS[:60].reshape(20, 3, 16)
    names['send'](batches.tolist(), 1_000_000, ('127.0.0.1', port))
    volts = np.concatenate([s.volts for _ in batches for s in source.read()])
    np.testing.assert_array_equal(volts, 1e-3 * INTEGERS[:60])
    assert +source.counts == {'packets': 20, 'samples': 60}
    source.close()


def test_the_tables_say_what_the_code_does():
    kinds = re.findall(r'^\| (0x\w+) \| `(\w+)` \| (\d) \|', TEXT, re.M)
    assert {name: int(kind, 16) for kind, name, _ in kinds} == KINDS
    for kind, name, value_bytes in kinds:
        assert len(encode([[1]], name, 0, 0)) == HEADER.size + int(value_bytes) + CHECKSUM.size
        assert encode([[1]], name, 0, 0)[0] == int(kind, 16)
    assert f'at most {LONGEST_BYTES} bytes' in TEXT
    fields = re.findall(r'^\| (\d+) \| (\d+) \| (\w+) \|', TEXT, re.M)
    offsets = [int(offset) for offset, _, _ in fields]
    lengths = [int(length) for _, length, _ in fields]
    assert offsets == [sum(lengths[:k]) for k in range(len(lengths))]
    assert sum(lengths) == HEADER.size


def test_every_count_is_explained():
    explained = set(re.findall(r'`(\w+)`', TEXT))
    for doc in (packets.PacketDecoder.__doc__, packets.LineDecoder.__doc__):
        assert set(re.findall(r'``(\w+)``', doc.partition('counts :')[2])) <= explained
