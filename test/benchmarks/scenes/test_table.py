"""The figures of the scenes as text."""

import json

from benchmarks.scenes.table import scenes_table


def test_the_table_has_all_and_fits(scenes_figures):
    text = scenes_table(scenes_figures)
    assert max(map(len, text.splitlines())) <= 99
    for word in ('plate: ', 'object: ', 'closed form', 'LSODA', 'Radau', 'front.ratio', 'met'):
        assert word in text


def test_the_result_is_json(scenes_figures):
    assert json.loads(json.dumps(scenes_figures, allow_nan=False))['precision'][0]['runs']
