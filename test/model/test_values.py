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

"""The table of facts about value types, against numpy, Python's struct and C."""

from array import array
import struct

import cffi
from fret_monitor.model.values import ValueType
import numpy
import pytest


@pytest.mark.parametrize('kind', ValueType)
def test_a_type_has_one_size_in_c_numpy_and_array(kind: ValueType) -> None:
    sizes = {cffi.FFI().sizeof(kind.c_name), numpy.dtype(kind.value).itemsize,
             array(kind.typecode).itemsize, struct.calcsize('=' + kind.typecode), kind.bits // 8}
    assert sizes == {kind.size}


@pytest.mark.parametrize('kind', [kind for kind in ValueType if kind.is_integer])
def test_integers_have_the_limits_of_numpy(kind: ValueType) -> None:
    facts = numpy.iinfo(kind.value)
    assert kind.limits == (facts.min, facts.max)
    assert kind.is_signed == (facts.min < 0)


@pytest.mark.parametrize('kind', [ValueType.FLOAT32, ValueType.FLOAT64])
def test_floats_have_no_integer_limits(kind: ValueType) -> None:
    with pytest.raises(ValueError, match=kind.value):
        _ = kind.limits


def test_byte_and_char_are_stored_as_uint8() -> None:
    assert ValueType.of_field('byte') is ValueType.of_field('char') is ValueType.UINT8
    assert ValueType.of_field('float32') is ValueType.FLOAT32
