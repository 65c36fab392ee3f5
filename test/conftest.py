"""Settings of the whole test run."""

from hypothesis import settings

# Derandomised: a run says the same about the same code, here and on every other machine.
settings.register_profile(
    'slip_detector', deadline=None, derandomize=True, max_examples=60, database=None
)
settings.load_profile('slip_detector')
