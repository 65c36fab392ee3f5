"""A plugin of pytest that has the package run as on a robot without Numba."""

import sys


def pytest_load_initial_conftests():
    """Hide Numba before anything of the package is imported."""
    sys.modules['numba'] = None
