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
  old: '(of an older text)',
  live: 'Watch a running monitor',
  namespace: 'Namespace',
  connect: 'Connect', disconnect: 'Disconnect', connecting: 'connecting',
  pause: 'Pause', resume: 'Go on', reset: 'Reset the monitor', monitor: 'Monitor',
  shownSpan: 'Shown',
  span: (seconds) => seconds < 60 ? `${seconds} s` : `${seconds / 60} min`,
  ago: (seconds) => `${words.span(seconds)} ago`, now: 'now',
  notWatching: 'No monitor is watched.',
  searching: 'looking for a monitor',
  noMonitor: 'No monitor publishes copilot/violations here. Is it active, in this namespace, '
    + 'and with the same ROS_DOMAIN_ID? ',
  watchIn: (name) => `Watch ${name}`,
  startOne: 'In a terminal in which ROS 2 is sourced, this starts one, of what is saved:',
  watching: (names) => `watching ${names.join(', ')}`,
  violations: 'Violations', over: 'over',
  health: 'Health', levels: ['ok', 'warning', 'error'],
  notKnown: 'not known',
  more: (n) => `and ${n} more at this time`,
  leftOut: (names) => `Without a plot, since it is computed from a message: ${names.join(', ')}.`,
  notInstalled: (names) => `Without a plot, since its message type is not installed: ${
    names.join(', ')}.`,
  parts: 'Parts of this page',
  nav: { write: 'Bundle', read: 'Meaning', try: 'Trace', picture: 'Picture',
    recordings: 'Recordings', live: 'Live' },
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
  lost: 'The server cannot be reached. What is written here is kept as long as this page is '
    + 'open. If the server has ended, copy it, or start the server again with the same --port '
    + 'and open the new address.',
  changed: (name) => `${name} was changed on disk by somebody else.`,
  gone: (name) => `${name} is not there any more, or cannot be read.`,
  reload: 'Read it again (what is not saved here is lost)',
  keep: 'Keep what is here',
  overwrite: 'Save what is here over it',
  anew: 'Write it anew',
  askSave: (name) => `Write ${name}?`,
  askName: 'Name of the file, in this folder:',
  yes: 'Write',
  no: 'Cancel',
  restored: 'This is what was not saved.',
  moreDrafts: (count) => `There ${count === 1 ? 'is 1 more text' : `are ${count} more texts`} of `
    + 'this file that a closed tab has not saved: save this one and open the file again.',
  elsewhere: 'Another tab has changes of this file that are not saved; they are not in this one.',
  noRoom: 'The storage of the browser is full: what is written here is lost when this page is '
    + 'closed. Save it.',
  requirement: 'Requirement',
  noBundle: 'When the bundle has no errors, its requirements are explained here.',
  reading: 'looking for examples',
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
  exportCsv: 'CSV', exportFret: 'JSON of FRET', importTrace: 'Read CSV or JSON of FRET',
  noFret: 'this is no file of traces of the simulator of FRET',
  noNumbers: 'the JSON of FRET has no NaN and no infinity: export it as CSV',
  firstOf: (count, name) => `the first of ${count} traces, ${name}`,
  badValue: (step, name, value) => `step ${step}: '${value}' is no value of ${name}`,
  margins: 'Margins', marginOf: (id) => `margin of ${id}`, noMargin: 'none',
  satisfied: 'satisfied', violated: 'violated', notJudged: 'not judged',
  judging: 'computing',
  rowsWith: 'Rows whose name has',
  moreProblems: (count) => `and ${count} more`,
  verdicts: 'Verdicts', inputs: 'Inputs',
  uneven: 'the times of the table are not evenly spaced: this page has one time between two rows',
  fix: 'Fix', noHead: 'the first line of a table has the names of the inputs',
  badCell: (line, name, cell) => `line ${line}: '${cell}' is no value of ${name}`,
  unknown: (name) => `the table has no column for ${name}: it stays as it is`,
  why: 'why?',
  whyText: (id, first, last, unit) => last === null
    ? `${id} is violated from ${unit(first)} to the end of the trace.`
    : `${id} is violated from ${unit(first)} until ${unit(last)}.`,
  deadlinePassed: (trigger, after) => `The trigger came at ${trigger}; the deadline passed `
    + `${after} later.`,
  lastTrigger: (trigger) => `The last trigger before it came at ${trigger}.`,
  silent: (names) => `No message for ${names}.`,
  valuesThen: (values) => `Values then: ${values}.`,
  atStep: (step) => `step ${step}`, stepsLong: (count) => `${count} step${count === 1 ? '' : 's'}`,
  notViolated: 'It is not violated at this step.',
  picture: 'Picture',
  pictureLabel: 'Topics, inputs, definitions, requirements and actions of the bundle; arrows move',
  pictureKinds: { topic: 'Topics', input: 'Inputs', definition: 'Definitions',
    requirement: 'Requirements', action: 'Actions and gates', gate: 'Actions and gates' },
  pictureKind: { topic: 'topic', input: 'input', definition: 'definition',
    requirement: 'requirement', action: 'action', gate: 'gate' },
  pictureNode: (kind, name, detail, sources, targets, level) => [
    `${kind} ${name}`, detail, sources && `reads ${sources}`, targets && `read by ${targets}`,
    level].filter(Boolean).join('; '),
  newHelp: 'Only component and response are necessary. For example: condition “when bumper”, '
    + 'component “robot”, timing “within 2 seconds”, response “speed <= 0.05”. If the bundle has '
    + 'no input of a name yet, write the requirement into it: below the text is a fix.',
  newRequirement: 'New requirement', newId: 'Id', addRequirement: 'Write it into the bundle',
  brokenNow: 'broken now',
  form: 'Fields of the sentence; what is written here is written into the text',
  fieldNames: { scope: 'scope', condition: 'condition', component: 'component',
    probability: 'probability', timing: 'timing', response: 'response' },
  fieldHints: { scope: 'always in force', condition: 'from the begin', probability: 'in any case',
    timing: 'eventually', component: 'robot', response: 'speed <= 1.0' },
  recordings: 'Recordings',
  recording: 'Recording', open: 'Open', openingRecording: 'reading the recording',
  noRecordings: 'There is no recording in this folder.',
  previous: 'Previous occurrence', next: 'Next occurrence',
  from: 'From (s)', to: 'to', zoom: 'Zoom', all: 'All of it', takeOver: 'Try it on a trace',
  occurrences: (count) => count ? `${count} occurrence${count === 1 ? '' : 's'}`
    : 'no occurrence',
  occurrence: (number, count, id, at) => `occurrence ${number} of ${count}: ${id} at `
    + `${Number(at.toPrecision(9))} s`,
  taken: (count) => `Taken over: a step for each of ${count} messages. A requirement that reads `
    + 'fewer topics has fewer steps in the monitor.',
  takenEvenly: (count, period) => `Taken over: ${count} steps, ${period} s apart, with the values `
    + 'of these instants.',
  late: (names) => `No value at the begin of the stretch, the first one is drawn from there: `
    + `${names.join(', ')}.`,
  truth: (value) => value ? 'true' : 'false',
  laneLabel: (name) => `${name}, by steps`,
};
