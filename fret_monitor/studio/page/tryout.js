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

// A trace that is drawn, and the verdicts of all requirements on it.

import { h, show } from './dom.js';
import { Lane, scale, View } from './lanes.js';
import { report } from './report.js';
import { MOST, parsed, readCsv, readFret, Trace, writeFret } from './trace.js';
import { words } from './words.js';

// What a lane needs to know of a margin; it cannot be drawn.
const MARGIN = { isBool: false, isFloat: true, names: [] };
const LATE_MS = 300; // verdicts that take longer are said to be computed

export class Tryout {
  #place;
  #ask;
  #bundle = null;
  #trace = new Trace();
  #view = new View();
  #verdicts = {};
  #margins = {};
  #hasMargins = false;
  #lanes = [];
  #isWaiting = true; // for verdicts
  #asked = 0;
  #active = null; // the input whose value is typed
  #parts = {};

  // `ask` as of the editor, with the bundle in the question.
  constructor(place, ask) {
    this.#place = place;
    this.#ask = ask;
    this.#view.addEventListener('chosen', () => this.#draw());
    this.#view.addEventListener('moved', () => this.#draw());
    addEventListener('resize', () => this.#draw());
  }

  // Show the inputs of another version of the bundle.
  use(bundle) {
    const shape = (found) => JSON.stringify([found?.inputs, found?.judged, found?.isTimed]);
    const before = shape(this.#bundle);
    this.#bundle = bundle;
    this.#trace.fit(bundle.inputs);
    if (before !== shape(bundle)) this.#build();
    this.#judge();
  }

  get #seconds() {
    return this.#bundle.isTimed ? this.#trace.period : this.#bundle.period;
  }

  #build() {
    const { inputs, judged } = this.#bundle;
    const steps = () => this.#trace.steps;
    const lane = (input) => new Lane(input.name, this.#view, {
      input, steps, end: steps, changes: () => this.#trace.values[input.name],
      set: (first, last, value) => this.#set(input, first, last, value),
      enter: () => this.#parts.value.focus() });
    const isWaiting = () => this.#isWaiting;
    const verdict = (id) => new Lane(id, this.#view, {
      isWaiting, steps, end: steps, changes: () => this.#asSteps(this.#verdicts[id] ?? []) });
    const margin = (id) => new Lane(words.marginOf(id), this.#view, {
      input: MARGIN, isWaiting, steps, end: steps,
      changes: () => this.#asSteps(this.#margins[id] ?? []) });
    const above = inputs.map(lane);
    const below = judged.flatMap((id) => this.#hasMargins
      ? [verdict(id), margin(id)] : [verdict(id)]);
    this.#lanes = [...above, ...below];
    above.forEach((each, number) => each.picture.addEventListener('focus', () => {
      this.#active = inputs[number];
      this.#draw();
    }));
    this.#active = inputs.find((item) => item.name === this.#active?.name) ?? inputs[0] ?? null;
    this.#parts = this.#controls();
    show(this.#place,
      h('p', { class: 'faint' }, words.drawing), this.#parts.tools,
      h('div', { class: 'rows' },
        ...above.flatMap((each) => this.#row(each)), h('span'), this.#parts.scale, h('span'),
        ...below.flatMap((each) => this.#row(each))),
      this.#parts.why, this.#parts.typed, this.#parts.examples, this.#parts.note);
    this.#draw();
  }

  #row(lane) {
    lane.shown = lane.input ? h('output', { class: 'now' }) : h('button', {
      type: 'button', class: 'now', disabled: true, onclick: () => this.#why(lane.name) });
    return [h('span', { class: 'name', title: lane.name }, lane.name), lane.picture, lane.shown];
  }

  #controls() {
    const { judged, isTimed } = this.#bundle;
    const button = (label, run) => h('button', { type: 'button', onclick: run }, label);
    const zoom = (factor) => () => this.#view.zoom(factor, this.#trace.steps);
    const pan = (part) => () => this.#view.pan(
      Math.round(part * this.#view.count), this.#trace.steps);
    const steps = h('input', {
      type: 'number', min: 1, max: MOST, value: this.#trace.steps, id: 'steps',
      onchange: () => this.#resize(Number(steps.value)) });
    const period = h('input', {
      type: 'number', min: 0, step: 'any', value: this.#trace.period, id: 'period',
      onchange: () => {
        if (Number(period.value) > 0) this.#trace.period = Number(period.value);
        this.#draw();
        this.#judge();
      } });
    const value = h('input', {
      id: 'value', size: 10, list: 'names', autocomplete: 'off',
      onkeydown: (event) => { if (event.key === 'Enter') this.#type(value.value); } });
    const names = h('datalist', { id: 'names' });
    const file = h('input', {
      type: 'file', accept: '.csv,.json,text/csv,application/json', hidden: true, id: 'csv-file',
      onchange: () => this.#import(file) });
    const margins = h('input', {
      type: 'checkbox', id: 'margins', checked: this.#hasMargins, onchange: () => {
        this.#hasMargins = margins.checked;
        this.#build();
        this.#judge();
      } });
    const options = (others) => others.map((id) => h('option', { value: id }, id));
    const chosen = h('select', { id: 'example-of', 'aria-label': words.requirement },
      ...options(judged));
    const other = h('select', { id: 'other', 'aria-label': words.apart },
      ...options(judged));
    if (judged.length > 1) other.value = judged[1];
    const show_ = (kind) => () => this.#example([chosen.value], kind);
    return {
      steps, period, value, names,
      selection: h('span', { class: 'faint', id: 'chosen' }),
      valueLabel: h('label', { for: 'value' }),
      scale: h('div'),
      why: h('div', { id: 'why', role: 'status' }),
      note: h('p', { role: 'status', id: 'trace-note' }),
      tools: h('div', { class: 'tools' },
        h('label', {}, words.steps, ' ', steps),
        isTimed ? h('label', {}, words.period, ' ', period) : null,
        button(words.zoomIn, zoom(0.5)), button(words.zoomOut, zoom(2)),
        button(words.earlier, pan(-0.5)), button(words.later, pan(0.5)),
        button(words.exportCsv, () => this.#export()),
        button(words.exportFret, () => this.#exportFret()),
        button(words.importTrace, () => file.click()), file,
        h('label', {}, margins, ' ', words.margins)),
      typed: h('div', { class: 'tools' }),
      examples: judged.length ? h('div', { class: 'tools' },
        h('label', {}, words.requirement, ' ', chosen), h('span', {}, words.example),
        ...Object.entries(words.kinds).map(([kind, label]) => button(label, show_(kind))),
        judged.length > 1 ? button(words.apart, () => this.#example(
          [chosen.value, other.value], 'violating')) : null,
        judged.length > 1 ? other : null) : null,
    };
  }

  #draw() {
    if (!this.#bundle) return;
    const { low, high, cursor } = this.#view;
    for (const lane of this.#lanes) {
      lane.draw();
      lane.shown.textContent = lane.text(cursor);
      if (!lane.input) {
        const isViolated = lane.text(cursor) === words.violated;
        lane.shown.className = `now verdict ${{ [words.satisfied]: 'is-true',
          [words.violated]: 'is-false' }[lane.text(cursor)] ?? ''}`;
        lane.shown.disabled = !isViolated;
        if (isViolated) lane.shown.textContent = `${words.violated}: ${words.why}`;
      }
    }
    const parts = this.#parts;
    const width = this.#lanes[0]?.picture.getBoundingClientRect().width ?? 0;
    const marks = scale(this.#view, this.#seconds, width);
    parts.scale.replaceWith(marks);
    parts.scale = marks;
    const time = this.#seconds ? `, ${Number((cursor * this.#seconds).toPrecision(9))} s` : '';
    parts.selection.textContent = words.chosen(low, high, time);
    const active = this.#active;
    if (!active) return;
    parts.names.replaceChildren(...active.names.map((name) => h('option', { value: name })));
    parts.valueLabel.textContent = `${active.name}: ${words.value}`;
    if (document.activeElement !== parts.value) {
      parts.value.value = String(this.#trace.at(active.name, cursor));
    }
    if (!parts.typed.childElementCount) {
      show(parts.typed, parts.selection, parts.valueLabel, parts.value, parts.names,
        h('button', { type: 'button', onclick: () => this.#type(parts.value.value) }, words.set));
    }
  }

  // Changes of verdicts are at times under `timed`: the step in which they fall.
  #asSteps(changes) {
    if (!this.#bundle.isTimed) return changes;
    return changes.map(([time, ...value]) => [time / this.#trace.period, ...value]);
  }

  #type(text) {
    const value = parsed(this.#active, text);
    if (value === undefined) {
      this.#tell(`'${text}' is no value of ${this.#active.name} (${this.#active.type})`);
    } else this.#set(this.#active, this.#view.low, this.#view.high, value);
  }

  #set(input, first, last, value) {
    this.#trace.set(input.name, Math.max(0, first), Math.min(last, this.#trace.steps - 1), value);
    this.#tell('');
    this.#draw();
    this.#judge();
  }

  // Show a trace from elsewhere: its steps, period and values.
  take(found, note) {
    if (!this.#bundle) return;
    if (found.period) this.#trace.period = found.period;
    this.#parts.period.value = this.#trace.period;
    Object.assign(this.#trace.values, found.values);
    this.#resize(found.steps);
    this.#tell(note);
  }

  // Say what has led to a violation at the chosen step, and mark it.
  async #why(id) {
    const { steps, period, values } = this.#trace;
    this.#tell(words.judging);
    try {
      const found = await this.#ask('why', {
        steps, period, values, id, step: this.#view.cursor });
      if (!found) {
        this.#tell(words.notViolated);
        return;
      }
      this.#tell('');
      this.#view.marks = [['violated', found.begin], ['trigger', found.trigger],
        ['over', found.end]].filter(([, step]) => step !== null);
      const drawing = report(
        `<figure><svg data-occurrence="${Number(found.place)}" role="img"></svg></figure>`,
        { ...found.data, unit: this.#seconds ? 's' : 'steps' });
      show(this.#parts.why, ...this.#reasons(id, found).map((text) => h('p', {}, text)), drawing);
      this.#draw();
    } catch (error) {
      if (error.message !== 'outdated') this.#tell(error.message);
    }
  }

  #reasons(id, found) {
    const long = (steps) => this.#seconds
      ? `${Number((steps * this.#seconds).toPrecision(9))} s` : words.stepsLong(steps);
    const at = (step) => this.#seconds ? long(step) : words.atStep(step);
    const reasons = [words.whyText(id, found.begin, found.end, at)];
    if (found.trigger !== null) {
      reasons.push(found.isDeadline
        ? words.deadlinePassed(at(found.trigger), long(found.begin - found.trigger))
        : words.lastTrigger(at(found.trigger)));
    }
    if (found.values.length) {
      reasons.push(words.valuesThen(found.values.map((pair) => pair.join(' = ')).join(', ')));
    }
    return reasons;
  }

  // What was said of a trace is not true of another one.
  #forget() {
    this.#view.marks = [];
    show(this.#parts.why);
  }

  #resize(steps) {
    this.#trace.resize(steps);
    this.#parts.steps.value = this.#trace.steps;
    this.#view.first = 0;
    this.#view.count = this.#trace.steps;
    this.#view.choose(Math.min(this.#view.cursor, this.#trace.steps - 1), this.#trace.steps);
    this.#judge();
  }

  async #judge(more = {}) {
    if (!more.csv) this.#forget();
    const { steps, period, values } = this.#trace;
    const number = ++this.#asked;
    const late = setTimeout(() => this.#wait(true), LATE_MS);
    try {
      const found = await this.#ask('simulate', {
        steps, period, values, margins: this.#hasMargins, ...more });
      this.#verdicts = found.verdicts;
      this.#margins = found.margins ?? {};
      this.#place.dataset.judged = String(Number(this.#place.dataset.judged ?? 0) + 1);
      return found;
    } catch (error) {
      if (error.message === 'outdated') return null;
      [this.#verdicts, this.#margins] = [{}, {}];
      if (this.#hasMargins) { // verdicts may be known without them
        this.#hasMargins = false;
        this.#build();
        await this.#judge(more);
      }
      this.#tell(error.message);
      return null;
    } finally {
      clearTimeout(late);
      if (number === this.#asked) this.#wait(false);
    }
  }

  #wait(isWaiting) {
    this.#isWaiting = isWaiting;
    this.#draw();
  }

  async #example(ids, kind) {
    this.#tell(words.reading);
    try {
      const found = await this.#ask('example', { ids, kind });
      this.take(found, '');
    } catch (error) {
      this.#tell(error.message);
    }
  }

  async #export() {
    const found = await this.#judge({ csv: true });
    if (found) save(found.csv, 'text/csv', 'trace.csv');
  }

  #exportFret() {
    const { inputs, judged } = this.#bundle;
    const found = writeFret(this.#trace, inputs, 'trace', judged);
    if (found === null) this.#tell(words.noNumbers);
    else save(found, 'application/json', 'trace.json');
  }

  async #import(file) {
    const text = await file.files[0].text();
    file.value = '';
    const read = /^\s*\[/.test(text) ? readFret : readCsv;
    const notes = read(this.#trace, this.#bundle.inputs, text, words);
    this.#parts.period.value = this.#trace.period;
    this.#resize(this.#trace.steps);
    this.#tell(notes.join('; '));
  }

  #tell(text) {
    if (this.#parts.note) this.#parts.note.textContent = text;
  }
}

function save(text, type, name) {
  const link = h('a', { href: URL.createObjectURL(new Blob([text], { type })), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}
