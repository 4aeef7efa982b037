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

"""`schema`: print the JSON schema of a bundle."""

from argparse import ArgumentParser, Namespace
import json

from fret_monitor.bundle.schema import bundle_schema


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Print the schema."""
    print(json.dumps(bundle_schema(), indent=2))
    return 0
