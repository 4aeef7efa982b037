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
import { OUTDATED } from './talk.js';
import { MOST, parsed, readCsv, readFret, Trace, writeFret } from './trace.js';
import { words } from './words.js';

// What a row needs to know of a margin or the value of a window; it cannot be drawn.
const NONE = [];
const NUMBER = { isBool: false, isFloat: true, names: [] };
const LATE_MS = 300; // verdicts that take longer are said to be computed
const PAUSE_MS = 400; // after a change of the text, before it is compiled
const NEAR = '2000px'; // of the window: rows that are drawn
const MANY = 20; // rows, which can be filtered

export class Tryout {
  #place;
  #ask;
  #bundle = null;
  #trace = new Trace();
  #view = new View();
  #verdicts = {};
  #margins = {};
  #windows = {};
  #hasMargins = false;
  #lanes = [];
  #pause = 0;
  #seen = new IntersectionObserver((entries) => entries.forEach(({ target, isIntersecting }) => {
    const lane = this.#lanes.find((each) => each.picture === target);
    if (!lane) return;
    lane.isSeen = isIntersecting;
    this.#drawLane(lane);
  }), { rootMargin: NEAR });
  #isWaiting = true; // for verdicts
  #asked = 0;
  #opened = 0; // files
  #failure = null; // why there are no verdicts
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

  // Show nothing, since the text is that of another file.
  clear() {
    clearTimeout(this.#pause);
    this.#opened += 1;
    this.#bundle = null;
    this.#lanes = [];
    [this.#verdicts, this.#margins, this.#windows] = [{}, {}, {}];
    this.#view.marks = [];
    this.#isWaiting = true;
    show(this.#place, h('p', { class: 'faint' }, words.noTrace));
  }

  // Show the inputs of another version of the bundle.
  use(bundle) {
    const shape = (found) => JSON.stringify([
      found?.inputs, found?.windows, found?.judged, found?.isTimed]);
    const before = shape(this.#bundle);
    this.#bundle = bundle;
    this.#trace.fit(bundle.inputs);
    const isFirst = !this.#lanes.length;
    if (before !== shape(bundle)) this.#build();
    clearTimeout(this.#pause);
    if (isFirst) this.#judge();
    else this.#pause = setTimeout(() => this.#judge(), PAUSE_MS);
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
      isWaiting, steps, end: steps, changes: () => this.#verdicts[id] ?? NONE });
    const margin = (id) => new Lane(words.marginOf(id), this.#view, {
      input: NUMBER, isWaiting, steps, end: steps,
      changes: () => this.#margins[id] ?? NONE });
    const window_ = (name) => new Lane(name, this.#view, {
      input: NUMBER, isWaiting, steps, end: steps, changes: () => this.#windows[name] ?? NONE });
    const drawn = inputs.map(lane);
    const above = [...drawn, ...this.#bundle.windows.map(window_)];
    const below = judged.flatMap((id) => this.#hasMargins
      ? [verdict(id), margin(id)] : [verdict(id)]);
    this.#lanes = [...above, ...below];
    this.#seen.disconnect();
    this.#lanes.forEach((each) => this.#seen.observe(each.picture));
    drawn.forEach((each, number) => each.picture.addEventListener('focus', () => {
      this.#active = inputs[number];
      this.#draw();
    }));
    this.#active = inputs.find((item) => item.name === this.#active?.name) ?? inputs[0] ?? null;
    this.#parts = this.#controls();
    show(this.#place,
      h('p', { class: 'faint' }, words.drawing), this.#parts.tools,
      this.#lanes.length > MANY ? this.#parts.filter : null,
      h('div', { class: 'rows' },
        ...above.flatMap((each) => this.#row(each)), h('span'), this.#parts.scale, h('span'),
        ...below.flatMap((each) => this.#row(each))),
      this.#parts.why, this.#parts.typed, this.#parts.examples, this.#parts.note);
    this.#draw();
  }

  #row(lane) {
    lane.shown = lane.input ? h('output', { class: 'now' }) : h('button', {
      type: 'button', class: 'now', disabled: true, onclick: () => this.#why(lane.name) });
    lane.parts = [
      lane.label, lane.picture, lane.shown];
    return lane.parts;
  }

  #filter(text) {
    const wanted = text.trim().toLowerCase();
    for (const { name, parts } of this.#lanes) {
      const isHidden = !name.toLowerCase().includes(wanted);
      parts.forEach((part) => part.classList.toggle('hidden', isHidden));
    }
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
    const filter = h('input', { id: 'rows-with', type: 'search', autocomplete: 'off',
      oninput: () => this.#filter(filter.value) });
    const show_ = (kind) => () => this.#example([chosen.value], kind);
    return {
      steps, period, value, names,
      filter: h('p', {}, h('label', {}, words.rowsWith, ' ', filter)),
      selection: h('span', { class: 'faint', id: 'chosen' }),
      valueLabel: h('label', { for: 'value' }),
      scale: h('div', { class: 'scale', 'aria-hidden': 'true' }),
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
    const parts = this.#parts;
    const width = parts.scale.getBoundingClientRect().width;
    for (const lane of this.#lanes) this.#drawLane(lane);
    const drawn = [this.#view.first, this.#view.count, this.#seconds, width].join();
    if (parts.drawn !== drawn) show(parts.scale, ...scale(this.#view, this.#seconds, width));
    parts.drawn = drawn;
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

  #drawLane(lane) {
    if (!lane.isSeen) return;
    lane.draw();
    const text = lane.text(this.#view.cursor);
    if (lane.said === text) return;
    lane.said = text;
    const isViolated = text === words.violated && !lane.input;
    lane.shown.textContent = isViolated ? `${text}: ${words.why}` : text;
    if (lane.input) return;
    const kind = { [words.satisfied]: 'is-true', [words.violated]: 'is-false' }[text] ?? '';
    lane.shown.className = `now verdict ${kind}`;
    lane.shown.disabled = !isViolated;
  }

  // Return the changes of rows by steps: under `timed` they come by times. What is the same stays.
  #kept(before, found, period) {
    const same = (one, other) => one && JSON.stringify(one) === JSON.stringify(other);
    return Object.fromEntries(Object.entries(found).map(([id, changes]) => {
      const steps = this.#bundle.isTimed
        ? changes.map(([time, ...value]) => [time / period, ...value]) : changes;
      return [id, same(before[id], steps) ? before[id] : steps];
    }));
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
      if (error.message !== OUTDATED) this.#tell(error.message);
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
    if (this.#view.marks.length) this.#view.marks = [];
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
    clearTimeout(this.#pause);
    if (!more.csv) this.#forget();
    const { steps, period, values } = this.#trace;
    const number = ++this.#asked;
    const opened = this.#opened;
    const late = setTimeout(() => this.#wait(true), LATE_MS);
    try {
      const found = await this.#ask('simulate', {
        steps, period, values, margins: this.#hasMargins, ...more });
      if (opened !== this.#opened) return null;
      this.#verdicts = this.#kept(this.#verdicts, found.verdicts, period);
      this.#margins = this.#kept(this.#margins, found.margins, period);
      this.#windows = this.#kept(this.#windows, found.windows, period);
      if (this.#parts.note.textContent === this.#failure) this.#tell('');
      this.#place.dataset.judged = String(Number(this.#place.dataset.judged ?? 0) + 1);
      return found;
    } catch (error) {
      if (error.message === OUTDATED || opened !== this.#opened) return null;
      [this.#verdicts, this.#margins, this.#windows] = [{}, {}, {}];
      if (this.#hasMargins) { // verdicts may be known without them
        this.#hasMargins = false;
        this.#build();
        await this.#judge(more);
      }
      this.#failure = error.message;
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
      this.#view.choose(found.steps - 1, this.#trace.steps); // where it is violated, or is not
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
