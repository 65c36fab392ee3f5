"""Settings of the whole test run."""

import os
import signal

from hypothesis import settings

from support.domains import own_domain

# A run in the background ignores SIGINT, and what it starts would too.
signal.signal(signal.SIGINT, signal.default_int_handler)

# For what the tests run as a user does.
os.environ['ROS_DOMAIN_ID'] = str(own_domain()[0])

# Derandomised: a run says the same about the same code, here and on every other machine.
settings.register_profile(
    'slip_detector', deadline=None, derandomize=True, max_examples=60, database=None
)
settings.load_profile('slip_detector')
