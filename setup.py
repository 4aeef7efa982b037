# Copyright 2026 The fret_monitor authors
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

"""
Tell setuptools, and through it colcon and pip, what `fret_monitor` is made of.

`install_requires` names what comes from PyPI alone. The message packages and `rclpy` belong to a
ROS 2 installation; the extra `ros` is for machines without one.
"""

from glob import glob

from setuptools import find_packages, setup

NAME = 'fret_monitor'
SHARED = ('config', 'config/sros2', 'docs', 'docs/pictures', 'examples', 'launch',
          *(folder.rstrip('/') for folder in sorted(glob('csrc/**/', recursive=True))))

# The releases that the tests ran with, and those that may replace them without a change of
# meaning. `fastrtps` is the middleware, which rclpy alone does not have; the common interfaces
# are std_msgs, sensor_msgs, visualization_msgs and the like.
ROS_WHEELS = [
    'ros-jazzy-common-interfaces>=5.3,<6',
    'ros-jazzy-rclpy[fastrtps]>=7.1.6,<7.2',
]

ROS_TEST_WHEELS = [
    'ros-jazzy-test-msgs>=2.0,<3',
]

# The same for the tests on another distribution.
KILTED_WHEELS = [
    'ros-kilted-common-interfaces>=5.5,<6',
    'ros-kilted-rclpy[fastrtps]>=9.1,<9.2',
]

KILTED_TEST_WHEELS = [
    'ros-kilted-test-msgs>=2.3,<3',
]

# What `fret-monitor bag` needs. Before 0.11.6 `rosbags` compares no checksums of chunks, before
# 0.11.7 it brings another package for zstd.
BAG = [
    'rosbags>=0.11.7,<0.12',
]

# What its option `--dask` needs.
DASK = [
    'distributed>=2024.1',
]

# What `fret-monitor prove` needs.
Z3 = 'z3-solver>=4.13'

PROVE = [
    'pycparser>=2.21',
    Z3,
]

ANALYZE = [
    'dd>=0.6,<0.7',
    Z3,
]

# What `fret-monitor lsp` needs.
LSP = [
    'pygls>=2,<3',
]

# What the parameter `metrics` of the nodes needs.
METRICS = [
    'prometheus-client>=0.19,<1',
]

# What `fret-monitor import` needs of a workbook.
XLSX = [
    'openpyxl>=3.1,<4',
]

# What `fret-monitor studio` needs.
STUDIO = [
    *BAG,
    'starlette>=0.40,<2',
    'uvicorn>=0.35,<1',
    'websockets>=14',
]

TEST = [
    *ANALYZE,
    *BAG,
    *DASK,
    *LSP,
    *METRICS,
    *PROVE,
    *STUDIO,
    *XLSX,
    'argcomplete>=3,<4',
    'catkin-pkg>=1',
    'colcon-core>=0.18',
    'colcon-ros>=0.5,<1',
    'coverage>=7.4',
    'flake8>=7,<8',
    'flake8-blind-except>=0.2,<1',
    'flake8-class-newline>=1.6,<2',
    'flake8-import-order>=0.18,<1',
    'hypothesis>=6.100,<7',
    'jsonschema>=4.18',
    'mypy>=1.11',
    'numpy>=1.26',
    'pytest>=7.4',
    'pytest-timeout>=2.2,<3',
    'pytest-xdist>=3.5,<4',
    'ruff>=0.6',
    # colcon still calls `setup.py develop --editable`, which setuptools 80 took away.
    'setuptools<80',
    'types-cffi',
    'types-PyYAML',
    'types-setuptools',
    'ziglang>=0.12',
]


def shared_files(folder):
    """
    Return where the files of a folder are installed to.

    :returns: a list of (folder below the prefix, files) for `setup(data_files=...)`, of one entry
        or none
    """
    files = sorted(glob(f'{folder}/*.*'))
    return [(f'share/{NAME}/{folder}', files)] if files else []


setup(
    name=NAME,
    version='0.1.0',
    description='Watch ROS 2 topics with requirements of NASA FRET, compiled to C.',
    author='The fret_monitor authors',
    author_email='fret-monitor@users.noreply.github.com',
    maintainer='The fret_monitor authors',
    maintainer_email='fret-monitor@users.noreply.github.com',
    license='Apache-2.0',
    python_requires='>=3.12',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={'': ['*.css', '*.h', '*.js', '*.json', '*.lark', 'py.typed'],
                  f'{NAME}.studio': ['page/*.*', 'page/vendor/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        *(entry for folder in SHARED for entry in shared_files(folder)),
    ],
    # lark, which makes the tables of the parsers from the grammars (tools/parser_tables.py), is
    # needed to change a grammar only. It is in no list: the ROS 2 wheels (rosidl) require
    # `lark-parser` (0.x), apt's python3-lark is 1.x, and one installed over the other breaks both.
    install_requires=['cffi>=1.16', 'PyYAML>=6'],
    extras_require={
        'analyze': ANALYZE, 'bag': BAG, 'dask': DASK, 'lsp': LSP, 'metrics': METRICS,
        'prove': PROVE,
        'ros': ROS_WHEELS,
        'ros-test': ROS_TEST_WHEELS, 'ros-kilted': KILTED_WHEELS,
        'ros-kilted-test': KILTED_TEST_WHEELS, 'studio': STUDIO, 'test': TEST, 'xlsx': XLSX,
    },
    entry_points={
        'console_scripts': [
            f'fret-monitor = {NAME}.cli.main:main',
            f'gate = {NAME}.ros.gate:main',
            f'logger = {NAME}.ros.logger:main',
            f'monitor = {NAME}.ros.monitor:main',
        ],
    },
    zip_safe=True,
)
