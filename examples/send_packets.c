// Copyright 2026 The slip_detector maintainers
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

/* Send the samples of a sensor to slip_driver over a serial line, as docs/packets.md describes.
 *
 * For a microcontroller: no library, no heap. The board has to provide send_byte and micros.
 */
#include <stdint.h>

#define CHANNELS 16
#define PERIOD_NS 1000000u /* 1 kHz; matters only with more than one sample in a packet */

/* Provided by the board: send a byte; return the time in us, which may wrap at 2^32 only. */
extern void send_byte(uint8_t byte);
extern uint32_t micros(void);

static uint32_t crc32(const uint8_t *data, uint32_t length)
{
    uint32_t crc = 0xFFFFFFFFu;
    while (length--) {
        crc ^= *data++;
        for (int bit = 0; bit < 8; bit++)
            crc = crc >> 1 ^ (crc & 1u ? 0xEDB88320u : 0u);
    }
    return ~crc;
}

static void put32(uint8_t *at, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(value >> 8 * i);
}

/* COBS: each block of bytes without a zero is preceded by its length plus one. */
static void send_stuffed(const uint8_t *data, uint32_t length)
{
    uint32_t begin = 0;
    for (;;) {
        uint32_t end = begin;
        while (end < length && data[end] && end - begin < 254)
            end++;
        send_byte((uint8_t)(end - begin + 1));
        for (uint32_t i = begin; i < end; i++)
            send_byte(data[i]);
        if (end == length)
            break;
        /* A short block includes the zero that ended it; a full block has none. */
        begin = end - begin == 254 ? end : end + 1;
    }
    send_byte(0);
}

/* Call it with each sample, right after the conversion. */
void send_sample(const int16_t values[CHANNELS])
{
    static uint32_t sequence;
    uint8_t packet[16 + 2 * CHANNELS + 4] = {0x12, CHANNELS, 1, 0};
    put32(packet + 4, sequence++);
    put32(packet + 8, micros());
    put32(packet + 12, PERIOD_NS);
    for (int channel = 0; channel < CHANNELS; channel++) {
        packet[16 + 2 * channel] = (uint8_t)values[channel];
        packet[17 + 2 * channel] = (uint8_t)((uint16_t)values[channel] >> 8);
    }
    put32(packet + sizeof packet - 4, crc32(packet, sizeof packet - 4));
    send_stuffed(packet, sizeof packet);
}
