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

"""The SROS2 policy of the examples allows what their nodes do, and nothing else."""

from pathlib import Path
from xml.etree import ElementTree

import pytest
from ros.harness import Partner, started, wait_until

ROOT = Path(__file__).resolve().parents[2]
QUADROTOR = ROOT / 'config' / 'quadrotor.yaml'
BUNDLES = {'monitor': QUADROTOR, 'logger': QUADROTOR, 'gate': ROOT / 'examples' / 'wall.yaml'}
POLICY = ROOT / 'config' / 'sros2' / 'policy.xml'

if not POLICY.is_file():
    pytest.skip('needs the source tree', allow_module_level=True)

Use = tuple[str, str]


def allowed(node: str) -> set[Use]:
    """Return what the policy allows a node: kind of use, and full name."""
    found: set[Use] = set()
    for profile in ElementTree.parse(POLICY).iterfind(f'.//profile[@node="{node}"]'):
        assert profile.get('ns') == '/'
        for names in profile:
            for what, rule in names.attrib.items():
                assert rule == 'ALLOW'
                found |= {(what, _full_name(node, item.text or '')) for item in names}
    return found


def _full_name(node: str, name: str) -> str:
    if name.startswith('~/'):
        return f'/{node}/{name[2:]}'
    return name if name.startswith('/') else f'/{name}'


def used(partner: Partner, node: str) -> set[Use]:
    """Return what a node does according to the graph."""
    asked = {
        'publish': partner.node.get_publisher_names_and_types_by_node,
        'subscribe': partner.node.get_subscriber_names_and_types_by_node,
        'reply': partner.node.get_service_names_and_types_by_node,
        'request': partner.node.get_client_names_and_types_by_node,
    }
    return {(what, name) for what, ask in asked.items() for name, _ in ask(node, '/')}


@pytest.mark.parametrize('executable', ['monitor', 'logger', 'gate'])
def test_the_policy_allows_what_a_node_does_and_nothing_else(
    partner: Partner, executable: str,
) -> None:
    node = f'fret_{executable}'
    expected = allowed(node)
    assert len(expected) > 10
    with started(executable, '-p', f'spec:={BUNDLES[executable]}'):
        wait_until(lambda: node in partner.node.get_node_names()
                   and used(partner, node) >= expected,
                   f'{node} does all of {sorted(expected)}')
        assert used(partner, node) == expected


def test_an_enclave_has_one_node_and_the_path_in_the_documentation() -> None:
    page = (ROOT / 'docs' / 'security.md').read_text(encoding='utf-8')
    enclaves = ElementTree.parse(POLICY).findall('.//enclave')
    assert len(enclaves) == 3
    for enclave in enclaves:
        assert len(enclave.findall('.//profile')) == 1
        assert f'--enclave {enclave.get("path")}' in page
