"""How much of the scenes is measured."""

from typing import NamedTuple


class SceneSizes(NamedTuple):
    """How much is measured.

    Attributes
    ----------
    tolerances : tuple of float
        Of the methods that do whole scenes.
    explicit_tolerances : tuple of float
    steps_per_sample : tuple of int
        Of the live stepper.
    rounds : int
        How often what is fast is repeated.
    budget_s, stretch_budget_s : float
        For a method to do a scene, and a stretch.
    cost_rounds : int
    """

    tolerances: tuple[float, ...]
    explicit_tolerances: tuple[float, ...]
    steps_per_sample: tuple[int, ...]
    rounds: int
    budget_s: float
    stretch_budget_s: float
    cost_rounds: int


FULL = SceneSizes(
    (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8),
    (1e-3, 1e-5),
    (1, 2, 3, 4, 6, 8, 16, 32, 64),
    5,
    4.0,
    10.0,
    25,
)
QUICK = SceneSizes((1e-3, 1e-6), (1e-3,), (1, 8), 1, 1.0, 1.0, 2)
