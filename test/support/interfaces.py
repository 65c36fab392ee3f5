# Copyright 2026 The slip_detector maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Builds interface packages for rclpy out of their definitions, by the generators of ROS."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

#: The messages sensor_interfaces/PillarState and SensorState of Contactile's driver for ROS 2.
PILLAR = 'int32 id\nfloat32 dx\nfloat32 dy\nfloat32 dz\nfloat32 fx\nfloat32 fy\nfloat32 fz\n'
PILLAR += 'bool in_contact\nint32 slip_state\n'
PILLARS = 'int64 tus\nPillarState[] pillars\nfloat32 gfx\nfloat32 gfy\nfloat32 gfz\n'
PILLARS += 'float32 gtx\nfloat32 gty\nfloat32 gtz\nfloat32 friction_est\n'
PILLARS += 'float32 target_grip_force\nbool is_sd_active\nbool is_ref_loaded\nbool is_contact\n'

#: Where ROS is installed; wheels of it are where Python is, which no variable says.
PREFIXES = [
    prefix
    for prefix in map(Path, (*os.environ.get('AMENT_PREFIX_PATH', '').split(':'), sys.prefix))
    if (prefix / 'share' / 'rosidl_generator_c').is_dir()
]

#: The type supports that Fast DDS needs, each a library of its own.
SUPPORTS = ('rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c')


@mock.patch.dict(os.environ, AMENT_PREFIX_PATH=':'.join(map(str, PREFIXES)))
def build(folder, package, definitions, depends=('std_msgs', 'builtin_interfaces')):
    """Build a package of interfaces; put the folder on the path of Python to import it.

    Parameters
    ----------
    folder
        Where the package is made.
    package
        Its name.
    definitions
        Text of each definition by its file, such as ``msg/Taxel.msg``.
    depends
        Packages of the interfaces that the definitions name, and of those that these name.
    """
    pytest.importorskip('rosidl_generator_py', reason='needs the generators of ROS')
    python = Path(sysconfig.get_config_var('INCLUDEPY'))
    if not shutil.which('gcc') or not (python / 'Python.h').is_file():
        pytest.skip('needs a compiler, and the headers of Python')
    from rosidl_cli.command.translate.api import translate
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    folder, out = Path(folder), Path(folder, package)
    for name, text in definitions.items():
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(text)
    shares = [prefix / 'share' / name for prefix in PREFIXES for name in depends]
    includes = [str(share) for share in shares if share.is_dir()]
    sources = [f'{out}:{name}' for name in definitions]
    idl = translate(
        package_name=package, interface_files=sources, include_paths=includes, output_format='idl',
        output_path=out,
    )  # fmt: skip
    includes.append(str(out))
    # Of C each kind by itself: it would take an action's hash for that of a message of its name.
    for kind in ('msg', 'srv', 'action'):
        of_kind = [path for path in idl if f':{kind}/' in path]
        GenerateC('').generate(package, of_kind, includes, output_path=out)
    # Some of its files have the names of others.
    inner = out / 'introspection'
    GenerateIntrospectionCTypesupport('').generate(
        package, idl, includes, output_path=inner / package
    )
    for generator in (
        GenerateCTypesupport('', typesupport_implementations=SUPPORTS),
        GenerateFastRTPSCTypesupport(''),
        GeneratePython('', typesupport_implementations=['rosidl_typesupport_c']),
    ):
        generator.generate(package, idl, includes, output_path=out)
    (out / '__init__.py').touch()
    headers = [python, np.get_include(), folder, inner]
    for prefix in PREFIXES:
        headers += [prefix / 'include', *(prefix / 'include').iterdir()]
    parts = [
        path
        for prefix in PREFIXES
        for name in (*depends, 'rosidl', 'rcutils', 'fastcdr')
        for path in (prefix / 'lib').glob(f'lib{name}*.so')
        if not path.name.endswith('_cpp.so')
    ]
    parts += [path for path in out.rglob('*') if path.suffix in ('.c', '.cpp')]
    # All code is in the first library. The others only need it: at run time each is looked for
    # by its name, and Python loads them all with the last.
    libraries = [f'lib{package}__{support}.so' for support in SUPPORTS]
    for name in (*libraries, f'{package}_s__rosidl_typesupport_c.so'):
        subprocess.run(
            [
                *('gcc', '-shared', '-fPIC', '-O0', '-w', *(f'-I{path}' for path in headers)),
                *('-Wl,--no-as-needed,-rpath,$ORIGIN', f'-Wl,-soname,{name}', '-o', name),
                *map(str, parts),
                '-lstdc++',
            ],
            check=True,
            cwd=out,
        )
        parts = [path for path in map(Path, libraries) if (out / path).exists()]
