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

"""Rows of CSV that any reader takes apart again: rows end with a newline."""

import csv
from typing import TextIO


class CsvWriter:
    """Writes rows with a newline at their ends, to a file that is open with `newline=''`."""

    def __init__(self, file: TextIO, delimiter: str = ',') -> None:
        """Write to a file."""
        # Before Python 3.13, `csv` quotes a carriage return only if it is part of the end of rows.
        rows = csv.writer(_Lines(file), delimiter=delimiter, lineterminator='\r\n')
        self.writerow, self.writerows = rows.writerow, rows.writerows


class _Lines:

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, row: str) -> None:
        """Write a row."""
        self._file.write(row.removesuffix('\r\n') + '\n')
