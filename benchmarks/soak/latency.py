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

"""Which received change belongs to which sample, and how late it was."""


def latencies_of_changes_ns(
    stamps_ns: list[int], states: list[bool], received: list[tuple[int, bool]]
) -> list[int | None]:
    """Return how long after its sample each change was received.

    Parameters
    ----------
    stamps_ns : list of int
        When the sample of each change was sent, in order.
    states : list of bool
        The state after each change.
    received
        Time in nanoseconds and state of each message, in order; each state differs from the one
        before.

    Returns
    -------
    list of int or None
        Latency of each change in nanoseconds; None where it was lost.

    Examples
    --------
    >>> latencies_of_changes_ns([0, 100], [True, False], [(5, True), (106, False)])
    [5, 6]
    >>> latencies_of_changes_ns([0, 100], [True, False], [(5, True)])
    [5, None]
    """
    # If nothing is lost, the k-th message is of the k-th change, however late it came. If some are
    # lost, a message belongs to a change only if it came before the next change to the same state.
    lost_some = len(received) < len(stamps_ns)
    latencies_ns: list[int | None] = []
    next_one = 0
    for k, (stamp_ns, state) in enumerate(zip(stamps_ns, states, strict=True)):
        j = next_one
        while j < len(received) and (received[j][0] < stamp_ns or received[j][1] != state):
            j += 1
        last = not lost_some or k + 2 >= len(stamps_ns)
        if j < len(received) and (last or received[j][0] < stamps_ns[k + 2]):
            latencies_ns.append(received[j][0] - stamp_ns)
            next_one = j + 1
        else:
            latencies_ns.append(None)
    return latencies_ns
