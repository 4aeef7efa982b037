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

// A trace: for each input its changes, as a list of [first step, value].

export const MOST = 100000;

export function startValue(input) {
  if (input.initial !== null) return input.initial;
  if (input.isBool) return false;
  return input.names.length ? input.names[0] : 0;
}

export class Trace {
  steps = 40;
  period = 0.1;
  values = {};

  // Keep what fits the inputs of a bundle.
  fit(inputs) {
    const fitted = {};
    for (const input of inputs) {
      const old = this.values[input.name];
      const fits = old?.every(([, value]) => isValue(input, value));
      fitted[input.name] = fits ? old : [[0, startValue(input)]];
    }
    this.values = fitted;
  }

  at(name, step) {
    const changes = this.values[name];
    return changes[place(changes, step)][1];
  }

  // Set a value from a step to another, both included.
  set(name, first, last, value) {
    const changes = this.values[name];
    const after = last + 1 < this.steps ? [[last + 1, this.at(name, last + 1)]] : [];
    const found = [
      ...changes.filter(([step]) => step < first), [first, value],
      ...after, ...changes.filter(([step]) => step > last + 1)];
    this.values[name] = found.filter(
      ([, each], number) => number === 0 || each !== found[number - 1][1]);
  }

  resize(steps) {
    this.steps = Math.max(1, Math.min(MOST, Math.round(steps) || 1));
    for (const name of Object.keys(this.values)) {
      this.values[name] = this.values[name].filter(([step]) => step < this.steps);
    }
  }
}

export function place(changes, step) {
  let low = 0;
  let high = changes.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (changes[middle][0] <= step) low = middle;
    else high = middle - 1;
  }
  return low;
}

export function isValue(input, value) {
  if (input.isBool) return typeof value === 'boolean';
  if (input.names.length && typeof value === 'string') return input.names.includes(value);
  if (typeof value === 'string') return /^(nan|-?inf)$/.test(value);
  return typeof value === 'number' && (input.isFloat || Number.isInteger(value));
}

// Return the value that a text means for an input; undefined if it means none.
export function parsed(input, text) {
  const word = text.trim();
  if (input.isBool) {
    return { 1: true, true: true, 0: false, false: false }[word.toLowerCase()];
  }
  if (input.names.includes(word)) return word;
  if (input.isFloat && /^(nan|-?inf)$/i.test(word)) return word.toLowerCase();
  const value = Number(word);
  return word !== '' && Number.isFinite(value) && isValue(input, value) ? value : undefined;
}

// Read a table into a trace; return what is wrong, or an empty list.
export function readCsv(trace, inputs, text, words) {
  const [head, ...rows] = text.replace(/^\uFEFF/, '').split(/\r\n|\n|\r/)
    .filter((line) => line.trim()).map((line) => line.split(',').map(
      (cell) => cell.trim().replace(/^"(.*)"$/, '$1')));
  if (!head || !rows.length) return [words.noHead];
  const notes = [];
  const found = {};
  for (const input of inputs) {
    const column = head.indexOf(input.name);
    if (column < 0) {
      notes.push(words.unknown(input.name));
      continue;
    }
    const changes = [];
    for (const [number, row] of rows.entries()) {
      const value = parsed(input, row[column] ?? '');
      if (value === undefined) return [words.badCell(number + 2, input.name, row[column] ?? '')];
      if (!changes.length || changes.at(-1)[1] !== value) changes.push([number, value]);
    }
    found[input.name] = changes;
  }
  if (!Object.keys(found).length) return [words.noHead];
  const time = head.indexOf('time');
  if (time >= 0 && rows.length > 1) {
    const times = rows.map((row) => Number(row[time]));
    const period = (times.at(-1) - times[0]) / (times.length - 1);
    const isEven = times.every(
      (each, number) => Math.abs(each - times[0] - number * period) < 1e-6 * period + 1e-9);
    if (!(period > 0 && isEven)) return [words.uneven];
    trace.period = Number(period.toPrecision(9));
  }
  trace.resize(rows.length);
  Object.assign(trace.values, found);
  return notes;
}

// Return a trace as the simulator of FRET saves it; null if it has values that JSON has not.
export function writeFret(trace, inputs, name, requirements) {
  const values = [];
  for (let step = 0; step < trace.steps; step += 1) {
    for (const input of inputs) {
      const value = trace.at(input.name, step);
      const number = input.numbers?.[input.names.indexOf(value)] ?? Number(value);
      if (!Number.isFinite(number)) return null;
      values.push(number);
    }
  }
  const of = (run) => inputs.map(run);
  const all = (input) => trace.values[input.name].map(
    ([, value]) => input.numbers?.[input.names.indexOf(value)] ?? Number(value));
  return JSON.stringify([{
    traceID: name, traceDescription: '', traceLinkedRequirementIDs: requirements,
    linkedProject: name, updatedFlag: '', saveToReqID: '*', saveToComponent: '*',
    saveToProject: '*',
    theTrace: {
      traceLength: trace.steps, keys: of((input) => input.name),
      type: of((input) => input.isBool ? 'category' : 'number'), canChange: of(() => true),
      minval: of((input) => Math.min(0, ...all(input))),
      maxval: of((input) => Math.max(1, ...all(input))), values },
  }], null, 1);
}

// Read the first trace of a file of FRET's simulator; return what is wrong or left out.
export function readFret(trace, inputs, text, words) {
  let traces;
  try {
    traces = JSON.parse(text);
  } catch (error) {
    return [words.noFret];
  }
  const found = (Array.isArray(traces) ? traces : [])[0]?.theTrace;
  const { keys, values } = found ?? {};
  const steps = Array.isArray(keys) && Array.isArray(values) ? values.length / keys.length : 0;
  if (!Number.isInteger(steps) || steps < 1 || steps > MOST) return [words.noFret];
  const notes = traces.length > 1 ? [words.firstOf(traces.length, traces[0].traceID)] : [];
  const read = {};
  for (const input of inputs) {
    const place = keys.indexOf(input.name);
    if (place < 0) {
      notes.push(words.unknown(input.name));
      continue;
    }
    const changes = [];
    for (let step = 0; step < steps; step += 1) {
      const given = values[step * keys.length + place];
      const value = input.isBool ? parsed(input, String(given))
        : input.names[input.numbers?.indexOf(Number(given))] ?? parsed(input, String(given));
      if (value === undefined) return [words.badValue(step, input.name, given)];
      if (!changes.length || changes.at(-1)[1] !== value) changes.push([step, value]);
    }
    read[input.name] = changes;
  }
  if (!Object.keys(read).length) return [words.noFret];
  trace.resize(steps);
  Object.assign(trace.values, read);
  return notes;
}
