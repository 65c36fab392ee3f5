"""A plugin of pytest that has the package run as on a robot without Numba."""

import sys

sys.modules['numba'] = None
