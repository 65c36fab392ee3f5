"""Benchmark of the simulated fingertip in stiff and extreme cases."""
