"""What the tests of the commands share."""

import pytest

from support.tuning_cases import PARAMETERS, write


@pytest.fixture
def case(tmp_path):
    """A parameter file and three short recordings."""
    (tmp_path / 'given.yaml').write_text(PARAMETERS)
    paths = [write(tmp_path / f'{name}.npz', seed) for seed, name in enumerate('abc', 4)]
    return tmp_path, [*paths, '--config', str(tmp_path / 'given.yaml')]
