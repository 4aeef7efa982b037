// Copyright 2026 The fret_monitor authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

// All texts of the page, in one place.

export const words = {
  write: 'Bundle',
  read: 'What it means',
  try: 'Try it on a trace',
  file: 'File',
  noFile: 'new file',
  save: 'Save',
  saveAs: 'Save as',
  format: 'Format',
  saved: 'saved',
  unsaved: 'not saved',
  checking: 'checking',
  good: 'no problems',
  problems: (errors, warnings) => [
    errors && `${errors} error${errors > 1 ? 's' : ''}`,
    warnings && `${warnings} warning${warnings > 1 ? 's' : ''}`].filter(Boolean).join(', '),
  lost: 'The server has ended. What is written here is kept as long as this page is open: '
    + 'copy it, or start the server again with the same --port and open the new address.',
  changed: (name) => `${name} was changed on disk by somebody else.`,
  reload: 'Read it again (what is not saved here is lost)',
  keep: 'Keep what is here',
  overwrite: 'Save what is here over it',
  askSave: (name) => `Write ${name}?`,
  askName: 'Name of the file, in this folder:',
  yes: 'Write',
  no: 'Cancel',
  restored: 'What was not saved when this page was closed is here again.',
  requirement: 'Requirement',
  noBundle: 'When the bundle has no errors, its requirements are explained here.',
  reading: 'looking for examples',
  fields: 'Fields of the sentence',
  formula: 'Formula',
  ifFalse: 'If false',
  notes: 'Notes',
  step: 'step',
  seconds: 's',
  steps: 'Steps',
  period: 'Seconds between two rows',
  noTrace: 'When the bundle has no errors, its inputs are drawn here.',
  drawing: 'Click or drag in a row to change it. With the keyboard: arrows move, Shift and arrows '
    + 'choose a stretch, Space changes a truth value, Enter goes to the value.',
  value: 'Value from the first to the last chosen step',
  chosen: (first, last, time) => first === last ? `step ${first}${time}`
    : `steps ${first} to ${last}${time}`,
  set: 'Set',
  example: 'Show me a trace that',
  kinds: { violating: 'violates it', satisfying: 'satisfies it', recovering: 'lets it recover' },
  apart: 'tells it apart from',
  zoomIn: 'Nearer', zoomOut: 'Farther', earlier: 'Earlier', later: 'Later',
  exportCsv: 'CSV', importCsv: 'Read CSV',
  satisfied: 'satisfied', violated: 'violated', notJudged: 'not judged',
  verdicts: 'Verdicts', inputs: 'Inputs',
  uneven: 'the times of the table are not evenly spaced: this page has one time between two rows',
  fix: 'Fix', noHead: 'the first line of a table has the names of the inputs',
  badCell: (line, name, cell) => `line ${line}: '${cell}' is no value of ${name}`,
  unknown: (name) => `the table has no column for ${name}: it stays as it is`,
  truth: (value) => value ? 'true' : 'false',
  laneLabel: (name) => `${name}, by steps`,
};
