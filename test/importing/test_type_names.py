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

"""Types by the names that other tools give them."""

from fret_monitor.importing.type_names import message_for, plain_type
from fret_monitor.messages.installed import find_message
from fret_monitor.model.values import ValueType
import pytest


@pytest.mark.parametrize('written, kind', [
    ('boolean', ValueType.BOOL), ('Bool', ValueType.BOOL), ('integer', ValueType.INT64),
    ('unsigned integer', ValueType.UINT32), ('single', ValueType.FLOAT32),
    ('Double', ValueType.FLOAT64), ('real', ValueType.FLOAT64), ('int32_t', ValueType.INT32),
    ('std::uint8_t', ValueType.UINT8), ('Float', ValueType.FLOAT32), ('Word16', ValueType.UINT16),
    ('Int64', ValueType.INT64), ('F64', ValueType.FLOAT64), ('position_t', None), ('', None)])
def test_names_of_types_of_other_tools_are_known(written: str, kind: ValueType | None) -> None:
    assert plain_type(written) is kind


@pytest.mark.parametrize('kind', ValueType)
def test_each_type_has_a_message_with_one_field_of_it(kind: ValueType) -> None:
    pytest.importorskip('std_msgs')
    [field] = find_message(message_for(kind)).fields
    assert field.type.base in (kind.value, 'boolean')
