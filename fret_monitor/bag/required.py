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

"""The package that reads recordings, which is optional."""

from fret_monitor.model.diagnostics import pip_install, refuse, require_packages

_ROSBAGS = 'rosbags>=0.11.7,<0.12'  # as in setup.py


def require_rosbags(what: str) -> None:
    """Refuse to run `what` without a release of rosbags that it can use."""
    require_packages(what, {'rosbags': _ROSBAGS})
    try:
        import fret_monitor.bag.recording  # noqa: F401
    except ImportError as error:  # earlier releases lack something that is needed
        refuse(f'{what} needs another release of rosbags: {error}', help=pip_install(_ROSBAGS))
