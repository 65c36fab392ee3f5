"""Which functions of the package are compiled."""

import sys


def compiled_signatures():
    """Return the functions that Python has called compiled, and for which types."""
    from numba.core.dispatcher import Dispatcher

    return {
        (f'{name}.{function}', signature)
        for name, module in list(sys.modules.items())
        if name.startswith('slip_detector.')
        for function, value in vars(module).items()
        if isinstance(value, Dispatcher) and value.py_func.__module__ == name
        for signature in value.signatures
    }
