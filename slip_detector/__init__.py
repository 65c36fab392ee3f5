"""ON/OFF slip from the raw voltages of tactile fingertips, after Romeo et al. (2017)."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slip_detector.chain.result import SlipResult
    from slip_detector.chain.slip_chain import SlipChain
    from slip_detector.parameters.detector import ChainConfig

__all__ = ['ChainConfig', 'SlipChain', 'SlipResult']


def __getattr__(name: str) -> Any:
    # Loaded when asked for: who wants parameters only need not load SciPy and Numba.
    if name == 'ChainConfig':
        from slip_detector.parameters.detector import ChainConfig

        return ChainConfig
    if name == 'SlipChain':
        from slip_detector.chain.slip_chain import SlipChain

        return SlipChain
    if name == 'SlipResult':
        from slip_detector.chain.result import SlipResult

        return SlipResult
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
