"""Parameters of the nodes from a file with a section for all of them."""

import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python

NODES = ('slip_driver', 'slip_detector', 'grasp_controller')


def values_of(bench, node, *names):
    request = GetParameters.Request(names=names)
    values = bench.ask(GetParameters, f'{node}/get_parameters', request).values
    return [parameter_value_to_python(value) for value in values]


def test_each_node_takes_what_it_knows_from_the_section_for_all(bench, tmp_path):
    file = tmp_path / 'all.yaml'
    file.write_text(
        '/**:\n  ros__parameters:\n    sample_rate_hz: 400.0\n    loop: true\n    limit_n: 8.0\n'
    )
    for node in NODES:
        bench.start(node, '--params-file', file)
    assert values_of(bench, 'slip_driver', 'loop') == [True]
    assert values_of(bench, 'slip_detector', 'sample_rate_hz') == [400.0]
    assert values_of(bench, 'grasp_controller', 'limit_n') == [8.0]
    assert values_of(bench, 'slip_driver', 'sample_rate_hz') in ([None], [])


@pytest.mark.parametrize('node', NODES)
@pytest.mark.parametrize(
    ('section', 'parameter'),
    [('/**', 'sample_rate_h: 400.0'), ('/**/{node}', 'missed_costs_ms: 1.0')],
)
def test_an_unknown_name_keeps_each_node_from_starting(bench, tmp_path, node, section, parameter):
    file = tmp_path / 'typo.yaml'
    file.write_text(f'{section.format(node=node)}:\n  ros__parameters: {{{parameter}}}\n')
    process = bench.start(node, '--params-file', file)
    assert process.wait() == 1
    (line,) = process.log().strip().splitlines()
    name, _, value = parameter.partition(': ')
    assert line.startswith(f'{node}: unknown parameter {name} = {value}; ')
