"""Benchmark of the simulated fingertip: error against run time, compared with SciPy."""
