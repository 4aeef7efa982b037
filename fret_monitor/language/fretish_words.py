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


"""The words and operators of FRETish, and the kinds of lexemes that its grammar makes of them."""

import re

from fret_monitor.language import _lalr
from fret_monitor.language.expression import Unit

UNITS = {
    **dict.fromkeys(('tick', 'ticks'), Unit.TICK),
    **dict.fromkeys(('microsec', 'microsecs', 'microsecond', 'microseconds'), Unit.MICROSECOND),
    **dict.fromkeys(('millisec', 'millisecs', 'millisecond', 'milliseconds'), Unit.MILLISECOND),
    **dict.fromkeys(('sec', 'secs', 'second', 'seconds'), Unit.SECOND),
    **dict.fromkeys(('minute', 'minutes'), Unit.MINUTE),
    **dict.fromkeys(('hour', 'hours'), Unit.HOUR),
}
ABBREVIATIONS = {
    **dict.fromkeys(('ms', 'msec', 'msecs'), 'milliseconds'),
    **dict.fromkeys(('us', 'usec', 'usecs'), 'microseconds'),
    **dict.fromkeys(('s',), 'seconds'),
    **dict.fromkeys(('min', 'mins'), 'minutes'),
    **dict.fromkeys(('h', 'hr', 'hrs'), 'hours'),
}
"""What people write for units of time, which FRET does not read in a timing."""
TIME_UNITS = {
    **UNITS, **{short: UNITS[word] for short, word in ABBREVIATIONS.items()},
    **dict.fromkeys(('ns', 'nsec', 'nsecs', 'nanosec', 'nanosecs', 'nanosecond', 'nanoseconds'),
                    Unit.NANOSECOND),
}
"""The units of a time in a bound, and in the arguments of a function; in any case."""
TIME = re.compile(rf'([0-9.]+) ?({"|".join(TIME_UNITS)})', re.IGNORECASE)
"""A time such as `100 ms`."""
_ONE_EACH = (
    'after', 'and', 'at', 'before', 'during', 'except', 'false', 'if', 'in', 'is', 'mode', 'next',
    'occurrence', 'of', 'only', 'or', 'previous', 'probability', 'satisfy', 'shall', 'the', 'then',
    'timepoint', 'true', 'unless', 'until', 'when', 'while', 'with')
WORDS = {
    **{word: word.upper() for word in _ONE_EACH},
    **dict.fromkeys(UNITS, 'UNIT'),
    **dict.fromkeys(('upon', 'where', 'whenever'), 'QUALIFIER'),
    **dict.fromkeys(('within', 'for'), 'SPAN'),
    **dict.fromkeys(('first', 'same', 'last'), 'WHICH'),
    **dict.fromkeys(('immediately', 'initially', 'finally', 'eventually', 'always', 'never'),
                    'PLAIN'),
    **dict.fromkeys(('xor', 'mod'), 'INFIX'),
    'not': 'NEGATION',
}
"""The kind of each word, in lower case; they are words in any case, unless in quotes."""

OPERATORS = {
    **_lalr.OPERATORS,
    '<->': ('INFIX', '<->'), '<=>': ('INFIX', '<->'), '->': ('INFIX', '->'),
    '=>': ('INFIX', '->'), '=': ('RELATION', '='),
    **{sign: ('FOREIGN', sign)
       for sign in ('&&', '||', '==', '<>', '%', '.', ';', ':', '[', ']', '{', '}')},
}
