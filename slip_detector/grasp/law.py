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

"""A control law for a grip, as an example of how to use slip.

The law knows neither weight nor friction. It holds the object lightly, raises the force when the
object slips, and lowers it slowly when the object has not slipped for a while.
"""

from slip_detector.parameters import GraspConfig

#: A raise follows the one before if it comes no later than this after ``repeat_s``.
LATEST_FOLLOWING_S = 0.05


class GraspLaw:
    """Computes the grip force over time from the decisions of the detector.

    - The grip closes to ``grip_n`` at ``closing_n_s``. A first contact looks like slip, so slip is
      ignored until the grip has been closed for ``settle_s``.
    - Slip raises the force at once by ``step_factor`` and ``step_n``, up to ``limit_n``. The raise
      is repeated while slip lasts, or when it comes again, but not sooner than ``repeat_s`` after
      the last one: the gripper needs time to follow, and the detector to see the effect.
    - The second of raises that follow each other counts double. An object that still slips then
      slides already: its friction is lower than at rest, its weight may be growing, and the object
      gets faster while the gripper follows, so that another step like the first is too small.
      Later raises count once, as the motion of the grip itself looks like slip.
    - When there has been no slip for ``relax_after_s``, the force falls at ``relax_n_s``, but not
      below ``grip_n``.
    - While slip is not valid the force stays as it is (``on_invalid: hold``) or falls at
      ``closing_n_s`` (``open``). A grip that has opened completely stays open.

    Parameters
    ----------
    config
        The parameters of the rules.

    Attributes
    ----------
    force_n : float
        The grip force to command.

    Examples
    --------
    >>> law = GraspLaw(GraspConfig(grip_n=2.0, closing_n_s=4.0, settle_s=0.3, step_factor=1.5))
    >>> [law.update(after_s, slip=False, valid=True) for after_s in (0.0, 0.5, 0.4)]
    [0.0, 2.0, 2.0]
    >>> law.update(0.1, slip=True, valid=True)  # It has closed and settled.
    3.0
    """

    def __init__(self, config: GraspConfig) -> None:
        self._config = config
        self.force_n = 0.0
        self._now_s = self._settled_s = 0.0
        self._raised_s = self._slipped_s = float('-inf')
        self._in_a_row = 0
        self._given_up = False

    def update(self, elapsed_s: float, slip: bool, valid: bool) -> float:
        """Return the grip force to command from now on.

        Parameters
        ----------
        elapsed_s
            Time since the last call.
        slip, valid
            The last states; ``valid`` is also false when messages have stopped.

        Returns
        -------
        float
            The force in newtons, which is also the attribute ``force_n``.
        """
        config = self._config
        self._now_s = now_s = self._now_s + elapsed_s
        if not valid:
            if config.on_invalid == 'open' and self.force_n > 0.0:
                self.force_n = max(self.force_n - config.closing_n_s * elapsed_s, 0.0)
                self._given_up = self.force_n == 0.0
        elif self._given_up:
            pass
        elif self.force_n < config.grip_n:
            self.force_n = min(self.force_n + config.closing_n_s * elapsed_s, config.grip_n)
            self._settled_s = now_s + config.settle_s
        elif slip:
            self._slipped_s = now_s
            since_s = now_s - self._raised_s
            if now_s >= self._settled_s and since_s >= config.repeat_s:
                follows = since_s < config.repeat_s + LATEST_FOLLOWING_S
                self._raised_s, self._in_a_row = now_s, self._in_a_row + 1 if follows else 1
                for _ in range(2 if self._in_a_row == 2 else 1):
                    raised_n = self.force_n * config.step_factor + config.step_n
                    self.force_n = min(raised_n, config.limit_n)
        elif now_s >= self._slipped_s + config.relax_after_s:
            self.force_n = max(self.force_n - config.relax_n_s * elapsed_s, config.grip_n)
        return self.force_n
