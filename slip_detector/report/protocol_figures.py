"""The counterparts of the paper's figures, drawn from the trials of its protocol."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from slip_detector.chain.filters import design
from slip_detector.chain.result import SlipResult
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.protocol_trials import (
    PAPER_DELAY_MS,
    PAPER_FALSE_POSITIVE_PERCENT,
    PlateTrial,
    band_name,
)
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]


def stages(trial: PlateTrial, config: ChainConfig, channel: int) -> dict[str, Floats]:
    """Return the signals of one channel after each stage of the chain (Eq. 1-8).

    Parameters
    ----------
    trial
        Without bad samples.
    config
        The chain's.
    channel
        Counted from 1, enabled.

    Returns
    -------
    dict
        By what the signal is and its unit, in the order of the stages: arrays of shape (n,). The
        last two are the chain's own envelope and the level that it holds against the threshold.

    Raises
    ------
    ValueError
        When the chain cannot be built.
    """
    result = SlipChain(config).update(trial.volts)
    # As the chain does: what counts is the deviation from the first row (the baseline).
    deviations = trial.volts - trial.volts[0]
    volts = deviations[:, channel - 1]
    if config.common_mode != 'none':
        enabled = [c for c in range(config.channels) if c + 1 not in config.disabled_channels]
        volts = volts - getattr(np, config.common_mode)(deviations[:, enabled], axis=1)
    filtered = signal.sosfilt(design(config), volts)
    rectified = np.abs(filtered) if config.rectify == 'full' else np.maximum(filtered, 0.0)
    unit = 'V' if config.exponent == 1 else f'V$^{config.exponent}$'
    return {
        'raw [V]': trial.volts[:, channel - 1],
        f'filtered,\ntimes {config.gain:g} [V]': filtered,
        f'rectified,\nto the power\nof {config.exponent} [{unit}]': rectified**config.exponent,
        f'RMS envelope\n[{unit}]': result.envelope[:, channel - 1],
        f'mean of the\nenvelope [{unit}]': result.level[:, channel - 1],
    }


def draw(
    folder: Path,
    plates: Mapping[str, Sequence[PlateTrial]],
    config: ChainConfig,
    result: Mapping[str, Any],
) -> list[Path]:
    """Draw the counterparts of the paper's Figs. 2, 4, 5, 6 and 7.

    Parameters
    ----------
    folder
        Where to; is made if it is not there.
    plates
        The trials by plate. The first of the first plate stands for all in Figs. 2 and 5.
    config
        The chain's.
    result
        Of :func:`evaluate_protocol` on these.

    Returns
    -------
    list of Path
        The pictures.

    Raises
    ------
    ValueError
        When a picture cannot be written; names it.
    """
    from slip_detector.report import plots

    chain = SlipChain(config)
    decisions = {
        plate: np.array([_decisions(trial, chain).slip for trial in trials])
        for plate, trials in plates.items()
    }
    first_plate, (trial, *_) = next(iter(plates.items()))
    decided = _decisions(trial, chain)
    channel = next(c for c in range(1, config.channels + 1) if c not in config.disabled_channels)
    of_trial = f'plate of {first_plate} µm, trial with the seed {result["seeds"][0]}'
    paths = {number: folder / f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)}
    try:
        plots.draw_stages(
            paths[2],
            trial.time_s,
            stages(trial, config, channel),
            decided.channels[:, channel - 1],
            config.threshold,
            trial.motion_s,
            f'{config.names[channel - 1]} from stage to stage; {of_trial}',
        )
        plots.draw_windows(paths[4], _by_plate(result['windows']), PAPER_FALSE_POSITIVE_PERCENT)
        plots.draw_trial(
            paths[5],
            trial.time_s,
            trial.volts,
            config,
            dict(zip(config.groups, decided.groups.T, strict=True)),
            decided.slip,
            trial.motion_s,
            f'Channels by group, decisions of the groups and of all; {of_trial}',
        )
        plots.draw_decisions(
            paths[6],
            {plate: trials[0].time_s for plate, trials in plates.items()},
            {plate: trials[0].position_m for plate, trials in plates.items()},
            decisions,
            {plate: trials[0].motion_s for plate, trials in plates.items()},
        )
        plots.draw_bands(
            paths[7],
            _by_plate(
                {
                    'as configured': result,
                    **{band_name(name): part for name, part in result['bands'].items()},
                }
            ),
            PAPER_DELAY_MS,
        )
    except OSError as error:
        raise ValueError(f'{folder}: cannot be written to ({error.strerror})') from None
    return list(paths.values())


def _decisions(trial: PlateTrial, chain: SlipChain) -> SlipResult:
    """Run a trial through a chain from its first row."""
    chain.reset()
    return chain.update(trial.volts, envelope=False, level=False)


def _by_plate(variants: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the figures by plate and variant."""
    plates = next(iter(variants.values()))['plates']
    return {
        plate: {name: part['plates'][plate] for name, part in variants.items()} for plate in plates
    }
