"""The measurements of ``slip_benchmark``, one module each."""
