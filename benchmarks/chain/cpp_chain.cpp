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

// The chain written by hand for one configuration: all stages of a row, then the next row, with
// the channels of each stage in arrays of a length that the compiler knows. The stages are those
// of slip_detector/chain/stages.py in the same order, so that decisions are equal. Votes are "all".
//
// The configuration comes as macros: CHANNELS, SECTIONS, ENVELOPE_ROWS, LEVEL_ROWS and GROUPS.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace {

// The mean over a window of rows, zeros before the first: the sum since the window's last start,
// and what is left of the stretch before.
template <int ROWS>
struct WindowedMean {
    double head[CHANNELS] = {};
    double tails[ROWS + 1][CHANNELS] = {};
    int row = 0;

    // Take a row of values and replace each by its mean, after what is done with it.
    template <class After>
    void update(double* values, After after) {
        double* own = tails[row];
        const double* tail = tails[row + 1];
        for (int c = 0; c < CHANNELS; ++c) {
            head[c] += values[c];
            own[c] = values[c];
            values[c] = after((head[c] + tail[c]) * (1.0 / ROWS));
        }
        if (++row < ROWS) {
            return;
        }
        row = 0;
        for (int k = ROWS - 2; k >= 0; --k) {
            for (int c = 0; c < CHANNELS; ++c) {
                tails[k][c] += tails[k + 1][c];
            }
        }
        std::fill(head, head + CHANNELS, 0.0);
    }
};

struct State {
    double last[CHANNELS];
    double repeats[CHANNELS] = {};
    double first[CHANNELS];
    double held[CHANNELS] = {};
    double delays[SECTIONS][2][CHANNELS] = {};
    WindowedMean<ENVELOPE_ROWS> envelope;
    WindowedMean<LEVEL_ROWS> level;

    State() {
        std::fill(last, last + CHANNELS, std::numeric_limits<double>::quiet_NaN());
        std::fill(first, first + CHANNELS, std::numeric_limits<double>::quiet_NaN());
    }
};

alignas(64) State state;

}  // namespace

// Take rows of volts, (rows, CHANNELS), and write their decisions as SlipResult.flags has them.
// sections: (SECTIONS, 6); members: channels of the groups, one group after the other; bounds:
// where each group begins, and the end of the last.
extern "C" void run(const double* __restrict volts, std::int64_t rows,
                    std::uint8_t* __restrict flags, const double* __restrict sections, double low,
                    double high, double flat_rows, double threshold,
                    const std::int64_t* __restrict members,
                    const std::int64_t* __restrict bounds) {
    for (std::int64_t row = 0; row < rows; ++row) {
        const double* samples = volts + row * CHANNELS;
        std::uint8_t* slip = flags + row * (1 + 2 * GROUPS + 2 * CHANNELS);
        std::uint8_t* groups = slip + 1;
        std::uint8_t* can_vote = groups + GROUPS;
        std::uint8_t* on = can_vote + GROUPS;
        std::uint8_t* valid = on + CHANNELS;
        double u[CHANNELS];
        for (int c = 0; c < CHANNELS; ++c) {
            const double sample = samples[c];
            const bool good = (sample >= low) & (sample <= high);
            const double again = sample == state.last[c] ? state.repeats[c] + 1.0 : 0.0;
            const double repeats = good ? again : state.repeats[c];
            const double before = state.first[c];
            const double first = good & (before != before) ? sample : before;
            const double deviation = sample - first;
            const double held = good ? deviation : state.held[c];
            state.last[c] = good ? sample : state.last[c];
            state.repeats[c] = repeats;
            state.first[c] = first;
            state.held[c] = held;
            valid[c] = good & (repeats < flat_rows);
            u[c] = held;
        }
        for (int s = 0; s < SECTIONS; ++s) {
            const double* b = sections + 6 * s;
            const double* a = b + 3;
            double* near = state.delays[s][0];
            double* far = state.delays[s][1];
            for (int c = 0; c < CHANNELS; ++c) {
                const double y = b[0] * u[c] + near[c];
                near[c] = (b[1] * u[c] + far[c]) - a[1] * y;
                far[c] = b[2] * u[c] - a[2] * y;
                u[c] = y;
            }
        }
        for (int c = 0; c < CHANNELS; ++c) {
            const double size = std::fabs(u[c]);
            const double power = size * size * size;
            u[c] = power * power;
        }
        state.envelope.update(u, [](double mean) { return std::sqrt(mean); });
        state.level.update(u, [](double mean) { return mean; });
        for (int c = 0; c < CHANNELS; ++c) {
            on[c] = u[c] > threshold;
        }
        bool any = false;
        for (int g = 0; g < GROUPS; ++g) {
            bool able = false;
            bool against = false;
            for (std::int64_t m = bounds[g]; m < bounds[g + 1]; ++m) {
                able |= valid[members[m]];
                against |= valid[members[m]] && !on[members[m]];
            }
            groups[g] = able && !against;
            can_vote[g] = able;
            any |= able && !against;
        }
        *slip = any;
    }
}
